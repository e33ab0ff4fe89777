"""`getup servo id`, `baud`, `reset`, `reboot`, `setup`: where servos reply, and what they keep."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from drivers.dynamixel.diagnostics import name_of
from drivers.dynamixel.protocol2 import Reset
from drivers.dynamixel.robot_ports import find_bus
from drivers.errors import DriverError
from drivers.service import servo_address
from drivers.service.calibrate import Prompt
from drivers.service.loose_servo import LooseServo, open_bus
from humanoid_getup.commands.command import program, write_json
from humanoid_getup.commands.console import console_for, count_of
from humanoid_getup.commands.errors import DID_IT, DID_NOT_STAND
from humanoid_getup.commands.inputs import choose_joints, load_robot, name_ports
from humanoid_getup.commands.options import ServiceOptions
from humanoid_getup.commands.prompt import open_prompt
from humanoid_getup.commands.servo.registers import ID, ConfirmedOptions, OneServo
from robots import Joint, Robot

KEPT = {"id-and-baud": Reset.ALL_BUT_ID_AND_BAUD, "id": Reset.ALL_BUT_ID, "nothing": Reset.ALL}
QUIT = "q"


@dataclass(frozen=True, kw_only=True)
class ChangeId(ConfirmedOptions):
    """Give a servo another id, which no other device on the port has."""

    new: Annotated[Positional[int], ID, arg(metavar="NEW_ID")]
    """Its new id."""


@dataclass(frozen=True, kw_only=True)
class ChangeBaud(ConfirmedOptions):
    """Give a servo another baud rate."""

    new: Annotated[Positional[int], arg(metavar="BIT/S")]
    """Its new baud rate [bit/s]."""


@dataclass(frozen=True, kw_only=True)
class RebootServo(OneServo):
    """Restart a servo, which clears an error that it has switched itself off for.

    It loses torque meanwhile.
    """


@dataclass(frozen=True, kw_only=True)
class ResetServo(ConfirmedOptions):
    """Set what a servo keeps without power to the values as shipped."""

    keep: Literal["id-and-baud", "id", "nothing"] = "id-and-baud"
    """What stays."""


@program("servo id")
def change_id(options: ChangeId) -> int:
    """Give a servo another id; 1 if the person declined."""
    with options.open() as servo:
        servo_address.check_new_id(servo, options.new)
        question, done = f"{servo.name} gets the id {options.new}", f"was id {servo.id}"
        change = partial(servo_address.change_id, servo, options.new)
        return _confirm(options, question, change, done)


@program("servo baud")
def change_baud(options: ChangeBaud) -> int:
    """Give a servo another baud rate; 1 if the person declined."""
    with options.open() as servo:
        servo_address.check_new_baud(servo, options.new)
        before = servo.bus.port.baud
        question = f"{servo.name} changes from {before} to {options.new} bit/s"
        change = partial(servo_address.change_baud, servo, options.new)
        return _confirm(options, question, change, f"was at {before} bit/s")


@program("servo reset")
def reset(options: ResetServo) -> int:
    """Set a servo to the values as shipped; 1 if the person declined."""
    with options.open() as servo:
        kept = KEPT[options.keep]
        servo_address.check_reset(servo, kept)
        rest = "its id as well" if kept is Reset.ALL else f"but {options.keep.replace('-', ' ')}"
        question = f"{servo.name} forgets all that it keeps without power, {rest}"
        return _confirm(options, question, partial(servo_address.reset_servo, servo, kept), "reset")


@program("servo reboot")
def reboot(options: RebootServo) -> int:
    """Restart a servo."""
    with options.open() as servo:
        return _report(servo.reboot(), options, "restarted")


def _confirm(
    options: ConfirmedOptions, question: str, change: Callable[[], LooseServo], done: str
) -> int:
    """Change a servo if the person agrees; return the exit code."""
    if not options.is_confirmed(console_for(options), question):
        return DID_NOT_STAND
    return _report(change(), options, done)


def _report(servo: LooseServo, options: OneServo, text: str) -> int:
    baud = servo.bus.port.baud
    write_json({"id": servo.id, "model": servo.table.model, "baud": baud}, options)
    console_for(options).print(f"[bold green]{servo.name}[/] replies at {baud} bit/s; {text}")
    return DID_IT


# The servos of a robot ----------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class SetUpServos(ServiceOptions):
    """Give the servos of a robot their ids and its baud rate, one after the other.

    Only one servo may be on the bus at a time: it is asked for by its joint. Servos that are set up
    already are left as they are, so that it can be repeated.
    """

    joint: Annotated[tuple[str, ...], arg(metavar="NAME,...")] = ()
    """Joints whose servos are set up; default: all."""


@program("servo setup")
def set_up(options: SetUpServos) -> int:
    """Set up the servos of a robot; 1 if the person left before the end."""
    console, robot = console_for(options), load_robot(options, takes_bench=True)
    chosen = reversed(choose_joints(robot, options.joint))  # from the end of each limb
    joints = [robot.joints[i] for i in chosen]
    if len(options.port) == 1:  # to which each servo is connected alone
        paths = dict.fromkeys(robot.joint_names, options.port[0].rpartition("=")[2])
    else:
        named, ports = name_ports(robot, options.port), find_bus(robot).ports
        paths = {name: named[port] for port, here in ports.items() for name in here}
    prompt = open_prompt(console, "the input ended before all servos were set up")
    if prompt is None:
        raise ValueError("standard input is not a terminal: servo setup needs a person")
    rows = []
    for number, joint in enumerate(joints, start=1):
        where = f"{number} of {len(joints)}: connect only {name_of(joint)}"
        before = _set_up_one(robot, joint, paths[joint.name], prompt, where)
        if before is None:
            break
        (old_id, old_baud), new_id = before, joint.servo.id
        rows.append({"joint": joint.name, "id": new_id, "old_id": old_id, "old_baud": old_baud})
    write_json(rows, options)
    if left := ",".join(joint.name for joint in joints[len(rows) :]):
        console.print(f"left: {left}; go on with --joint {left}")
        return DID_NOT_STAND
    count = count_of(len(rows), "servo")
    console.print(f"[bold green]set up: {count}[/]; connect all: getup doctor")
    return DID_IT


def _set_up_one(
    robot: Robot, joint: Joint, path: str, prompt: Prompt, where: str
) -> tuple[int, int] | None:
    """Set up the servo of a joint, again until it works; None if the person ends it."""
    baud, name = find_bus(robot).baud, name_of(joint)
    question = f"{where}, {joint.servo.model.name}, then Enter ({QUIT} ends):"
    while prompt.ask(question).strip().lower() != QUIT:
        try:
            with open_bus(path, baud) as bus:
                before = servo_address.set_up_servo(bus, robot, joint)
        except DriverError as error:
            prompt.tell(str(error))
            continue
        done = f"set up at {baud} bit/s; was id {before[0]} at {before[1]} bit/s"
        prompt.tell(f"{name}: {'was set up already' if before == (joint.servo.id, baud) else done}")
        return before
    return None
