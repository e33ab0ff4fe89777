"""A fallen OP3 gets up over a serial port: the real driver, and servos that speak Protocol 2.0.

Give the path of a robot's port and the same lines move the robot: read
docs/tutorial/first_connection.md first.
"""

import sys

import numpy as np

from drivers import SafetyGuard
from drivers.dynamixel.backend import DynamixelBackend
from drivers.dynamixel.clock import CycleClock
from drivers.twin.simulation import Simulation
from drivers.virtual_bus.serving.server import TimeMode
from drivers.virtual_bus.virtual_robot import VirtualPorts, VirtualRobot
from humanoid_getup.execution.get_up import get_up
from humanoid_getup.execution.result import RiseResult
from humanoid_getup.execution.rise_session import AttemptOptions, RiseSession
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.simulation.falls import sample_falls
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import RiseOptions
from humanoid_getup.strategies.planned_rise import PlannedRise
from robots import load_robot


def rise(world: World, backend: DynamixelBackend, *, realtime: bool) -> RiseResult:
    planner = PlannedRise(world, load_database(world.robot), RiseOptions())
    session = RiseSession(
        guard=SafetyGuard(backend),
        world=world,
        strategy=planner,
        options=AttemptOptions(realtime=realtime),
        services=backend,
    )
    return get_up(session, np.random.default_rng(0))


def main(port: str | None = None) -> bool:
    robot = load_robot("op3")
    world = World(robot)
    if port is not None:
        result = rise(world, DynamixelBackend(robot, {"main": port}), realtime=True)
    else:
        virtual = VirtualRobot(Simulation(world))
        virtual.place(sample_falls(world, {"prone": 1}, np.random.default_rng(3))[0].posture)
        with VirtualPorts(virtual, time_mode=TimeMode.LOCK_STEP) as ports:
            backend = DynamixelBackend(robot, ports.paths, clock=CycleClock(), answer_margin=0.2)
            result = rise(world, backend, realtime=False)
            print(backend.statistics["main"])
    print(f"{result.start_class}: {result.reason}, judged by sensors alone")
    return result.stood


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else None)
