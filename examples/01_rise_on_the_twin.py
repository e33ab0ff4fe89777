"""Let a fallen OP3 get up on the twin: fall, plan, filter, play, judge."""

import numpy as np

from drivers import Twin
from humanoid_getup.execution.get_up import get_up, lay_down
from humanoid_getup.execution.rise_session import AttemptOptions, RiseSession
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.simulation.falls import sample_falls
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import RiseOptions
from humanoid_getup.strategies.planned_rise import PlannedRise
from robots import TorqueLimit, load_robot


def main() -> bool:
    robot = load_robot("op3")
    world = World(robot)
    rng = np.random.default_rng(1)
    fall = sample_falls(world, {"prone": 1}, rng)[0]

    limit = TorqueLimit(3.0)
    planner = PlannedRise(world, load_database(robot), RiseOptions(torque_limit=limit))
    twin = Twin(world)
    lay_down(world, fall, twin.place)
    options = AttemptOptions(max_attempts=1, torque_limit=limit)
    result = get_up(RiseSession.on_twin(twin, world, planner, options), rng)

    connection = result.plan.connection
    if connection:
        print(f"joined {connection.motion.name} ({connection.motion.strategy})")
    print(f"{result.reason}: {result.record()['stand_time_s']} s")
    return result.stood


if __name__ == "__main__":
    main()
