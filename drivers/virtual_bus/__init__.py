"""A virtual robot on a virtual Dynamixel bus, for any program that speaks Protocol 2.0.

    with VirtualPorts(VirtualRobot(Simulation(robot)), time_mode=TimeMode.LOCK_STEP) as ports:
        backend = DynamixelBackend(robot, ports.paths)

`VirtualRobot` is a robot's servos, its controller board and its IMU, coupled to a MuJoCo simulation
by `servo_physics`; `VirtualPorts` serves it on pseudo-terminals.
`served_robot` chooses between lock-step, in one process, and real time.

- `devices` is the firmware: control tables in memory, servos and the board that execute
  instructions, and the chain that orders their replies. No clock, thread or physics.
  `Quirks` holds the choices that the manual leaves open.
- `serving` is the serial port: bytes in, instructions to the devices, replies out, either in real
  time (every byte takes as long as on a wire) or in lock-step with the client. It also injects
  faults, on demand or from a schedule file.
- `own_process` serves a robot in real time: devices and wire in one process, physics in another.
"""

from drivers.virtual_bus.serving.server import TimeMode
from drivers.virtual_bus.virtual_ports import VirtualPorts
from drivers.virtual_bus.virtual_robot import VirtualRobot

__all__ = ["TimeMode", "VirtualPorts", "VirtualRobot"]
