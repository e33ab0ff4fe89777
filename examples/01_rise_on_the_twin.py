"""A fallen OP3 gets up on the twin: fall, plan, filter, preflight, play, judge."""

import humanoid_getup as hg

robot = hg.load_robot("op3")
world = hg.World(robot)
fall = hg.sample_fall(world, "prone", seed=1)
with hg.Twin(world, fall.posture) as twin:
    result = hg.get_up(twin, hg.PlannedRise(world))
print(result)
