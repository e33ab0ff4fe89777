"""`getup servo setup`: the servos of a robot get their ids, one at a time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from drivers.dynamixel.diagnostics import name_of
from drivers.dynamixel.robot_bus import find_bus
from drivers.errors import DriverError
from drivers.service.calibrate import Prompt
from drivers.service.servos.loose_servo import open_bus
from drivers.service.servos.motor_setup import SetUpServo, list_joints, set_up_servo
from humanoid_getup.cli.options.servo import SetUpServos
from humanoid_getup.cli.shared.console import console_for, count_of
from humanoid_getup.cli.shared.exit_codes import DID_IT, DID_NOT_STAND
from humanoid_getup.cli.shared.output import write_json
from humanoid_getup.cli.shared.prompt import open_prompt
from humanoid_getup.jobs.errors import BadInputError
from humanoid_getup.jobs.inputs import load_robot, name_ports
from robots import Joint, Robot

QUIT = "q"


@dataclass(frozen=True, kw_only=True)
class SetUpRow:
    """A servo that was set up, for JSON."""

    joint: str
    id: int
    old_id: int
    old_baud: int
    """[bit/s]"""


def set_up(command: SetUpServos) -> int:
    """Set up the servos of a robot, one after the other; 1 if the person left before the end."""
    console, robot = console_for(command), load_robot(command, takes_bench=True)
    joints, paths = list_joints(robot, command.joint), _find_paths(robot, command.port)
    prompt = open_prompt(console, "the input ended before all servos were set up")
    if prompt is None:
        raise BadInputError("standard input is not a terminal: servo setup needs a person")
    done: list[SetUpServo] = []
    for number, joint in enumerate(joints, start=1):
        where = f"{number} of {len(joints)}: connect only {name_of(joint)}"
        servo = _set_up_one(robot, joint, paths[joint.name], prompt, where)
        if servo is None:
            break
        done.append(servo)
    write_json([_describe_row(servo) for servo in done], command)
    if left := [joint.name for joint in joints[len(done) :]]:
        console.print(f"left: {', '.join(left)}; go on with --joint {','.join(left)}")
        return DID_NOT_STAND
    console.print(
        f"[bold green]set up: {count_of(len(done), 'servo')}[/]; connect all: getup doctor"
    )
    return DID_IT


def _find_paths(robot: Robot, ports: Sequence[str]) -> dict[str, str]:
    """Find the port to which each joint's servo is connected: the only one, or its own."""
    if len(ports) == 1:
        return dict.fromkeys(robot.joint_names, ports[0].rpartition("=")[2])
    named = name_ports(robot, ports)
    return {name: named[port] for port, here in find_bus(robot).ports.items() for name in here}


def _set_up_one(
    robot: Robot, joint: Joint, path: str, prompt: Prompt, where: str
) -> SetUpServo | None:
    """Set up the servo of a joint, again until it works; None if the person ends it."""
    baud = find_bus(robot).baud
    question = f"{where}, {joint.servo.model.name}, then Enter ({QUIT} ends):"
    while prompt.ask(question).strip().lower() != QUIT:
        try:
            with open_bus(path, baud) as bus:
                servo = set_up_servo(bus, robot, joint)
        except DriverError as error:
            prompt.tell(str(error))
            continue
        prompt.tell(_describe(servo, baud))
        return servo
    return None


def _describe(servo: SetUpServo, baud: int) -> str:
    if not servo.is_changed(baud):
        return f"{name_of(servo.joint)}: was set up already"
    return (
        f"{name_of(servo.joint)}: set up at {baud} bit/s; was id {servo.old_id} at "
        f"{servo.old_baud} bit/s"
    )


def _describe_row(servo: SetUpServo) -> SetUpRow:
    return SetUpRow(
        joint=servo.joint.name,
        id=servo.joint.servo.id,
        old_id=servo.old_id,
        old_baud=servo.old_baud,
    )
