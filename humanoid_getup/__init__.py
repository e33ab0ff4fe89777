"""Get fallen humanoids up, on a twin, a virtual servo bus or a robot.

    import humanoid_getup as hg

    robot = hg.load_robot("op3")
    world = hg.World(robot)
    fall = hg.sample_fall(world, "prone", seed=1)
    with hg.Twin(world, fall.posture) as twin:
        result = hg.get_up(twin, hg.PlannedRise(world))
    print(result)

Each name is imported when it is first used.
"""

import os

from humanoid_getup.library_environment import prepare
from robots.lazy_names import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
prepare(os.environ)
