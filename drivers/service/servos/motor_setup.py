"""Gives the servos of a robot their ids and its baud rate, one servo at a time on the bus."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from drivers.dynamixel.bus import DynamixelBus
from drivers.dynamixel.control_table import table_named, types_of
from drivers.dynamixel.diagnostics import name_of
from drivers.dynamixel.robot_bus import find_bus
from drivers.errors import SetupError
from drivers.service.servos.guarded_motion import find_joints
from drivers.service.servos.loose_servo import LooseServo, NoServoError, find_any
from drivers.service.servos.maintenance import change_baud, change_id
from robots import Joint, Robot
from robots.bus_settings import BAUD_RATES


@dataclass(frozen=True)
class SetUpServo:
    """A servo that was set up."""

    joint: Joint
    old_id: int
    old_baud: int
    """[bit/s]"""

    def is_changed(self, baud: int) -> bool:
        """Return whether its id or its baud rate [bit/s] was another one."""
        return self.old_id != self.joint.servo.id or self.old_baud != baud


def list_joints(robot: Robot, names: Sequence[str] = ()) -> tuple[Joint, ...]:
    """List the joints to set up, by default all, from the end of each limb to the torso.

    Raises:
        SetupError: if the robot has no such joint.
    """
    return tuple(robot.joints[i] for i in reversed(find_joints(robot, names)))


def set_up_servo(bus: DynamixelBus, robot: Robot, joint: Joint) -> SetUpServo:
    """Give the only servo on a bus the id of a joint and the baud rate of its robot.

    Raises:
        SetupError: if no servo or several reply, it is of another model, or has torque.
        ServoError: if it does not reply afterwards.
    """
    servo = _find_alone(bus, robot)
    if joint.servo.model.name not in types_of(servo.table):
        raise SetupError(
            f"{servo.name} is on the bus, expected a {joint.servo.model.name} for {name_of(joint)}"
        )
    done = SetUpServo(joint, servo.id, bus.port.baud)
    change_baud(change_id(servo, joint.servo.id), find_bus(robot).baud)
    return done


def _find_alone(bus: DynamixelBus, robot: Robot) -> LooseServo:
    """Find the only servo, at any baud rate: the robot's first, then that as shipped."""
    table = table_named(robot.joints[0].servo.model.name)
    bus.searched = (table.wire,)
    shipped = table.bauds[table["baud_rate"].default or 0]
    found = find_any(bus, list(dict.fromkeys([find_bus(robot).baud, shipped, *BAUD_RATES])))
    if len(found) > 1:
        listed = ", ".join(str(servo.id) for servo in found)
        raise NoServoError(
            f"port {bus.port.path}: servos {listed} reply, expected one: unplug the others"
        )
    return found[0]
