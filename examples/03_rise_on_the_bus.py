"""A fallen OP3 gets up over a serial port: the real driver, and servos that speak Protocol 2.0.

Without an argument the servos are virtual. Give the path of a robot's port and the same driver
moves the robot: read docs/tutorial/first_connection.md first.
"""

import sys

import humanoid_getup as hg
from drivers.dynamixel.clock import CycleClock
from drivers.twin.simulation import Simulation
from drivers.virtual_bus import TimeMode, VirtualPorts, VirtualRobot

world = hg.World(hg.load_robot("op3"))
planner = hg.PlannedRise(world)
if len(sys.argv) > 1:
    result = hg.get_up(hg.DynamixelBackend(world.robot, {"main": sys.argv[1]}), planner)
else:
    virtual = VirtualRobot(Simulation(world))
    virtual.place(hg.sample_fall(world, "prone", seed=3).posture)
    with VirtualPorts(virtual, time_mode=TimeMode.LOCK_STEP) as ports:
        # In lock-step, simulated time waits for the driver: nothing has a deadline.
        backend = hg.DynamixelBackend(world.robot, ports.paths, clock=CycleClock())
        result = hg.get_up(backend, planner, options=hg.SessionOptions(realtime=False))
        print(backend.statistics["main"])
print(result)
