"""Two learned policies get up from the same falls, under the same torque limit by PWM."""

import humanoid_getup as hg

world = hg.World(hg.load_robot("op3"))
limit = hg.TorqueLimit(2.5, "pwm")
falls = [hg.sample_fall(world, side, seed=1) for side in ("supine", "prone", "left", "right")]
for name in ("robust", "gentle"):
    policy = hg.LearnedRise(world, name, torque_limit=limit)
    results = [hg.get_up(hg.Twin(world, f.posture), policy, max_attempts=1) for f in falls]
    print(*results, sep="\n")
    print(f"{name}: {sum(r.stood for r in results)} of {len(results)} stood")
