"""`getup servo id`, `baud`, `reset`, `reboot`, `setup`: where servos reply, and what they keep."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from drivers.dynamixel.diagnostics import name_of
from drivers.dynamixel.protocol2 import Reset
from drivers.dynamixel.robot_ports import find_bus
from drivers.errors import DriverError
from drivers.service.calibrate import Prompt
from drivers.service.loose_servo import LooseServo, open_bus, open_servo
from drivers.service.servo_address import (
    change_baud,
    change_id,
    check_new_baud,
    check_new_id,
    check_reset,
    reset_servo,
    set_up_servo,
)
from humanoid_getup.cli.options.servo import (
    ChangeBaud,
    ChangeId,
    ConfirmedOptions,
    OneServo,
    RebootServo,
    ResetServo,
    SetUpServos,
)
from humanoid_getup.cli.robot.servo.registers import NOT_WRITTEN
from humanoid_getup.commands.console import console_for, count_of
from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.exit_codes import DID_IT, DID_NOT_STAND
from humanoid_getup.commands.inputs import choose_joints, load_robot, name_ports
from humanoid_getup.commands.output import write_json
from humanoid_getup.commands.prompt import is_confirmed, open_prompt
from robots import Joint, Robot

KEPT = {
    "id-and-baud": Reset.ALL_BUT_ID_AND_BAUD,
    "id": Reset.ALL_BUT_ID,
    "nothing": Reset.ALL,
}
QUIT = "q"


def change_servo_id(command: ChangeId) -> int:
    """Give a servo another id; 1 if the person declined."""
    with open_servo(command.path, command.id, command.baud, command.protocol) as servo:
        check_new_id(servo, command.new)
        question = f"{servo.name} gets the id {command.new}: write?"
        done = f"was id {servo.id}"
        return _confirm(command, question, lambda: change_id(servo, command.new), done)


def change_servo_baud(command: ChangeBaud) -> int:
    """Give a servo another baud rate; 1 if the person declined."""
    with open_servo(command.path, command.id, command.baud, command.protocol) as servo:
        check_new_baud(servo, command.new)
        before = servo.bus.port.baud
        question = f"{servo.name} changes from {before} to {command.new} bit/s: write?"
        done = f"was at {before} bit/s"
        return _confirm(command, question, lambda: change_baud(servo, command.new), done)


def reset(command: ResetServo) -> int:
    """Set a servo to the values as shipped; 1 if the person declined."""
    with open_servo(command.path, command.id, command.baud, command.protocol) as servo:
        kept = KEPT[command.keep]
        check_reset(servo, kept)
        rest = "its id as well" if kept is Reset.ALL else f"but {command.keep.replace('-', ' ')}"
        question = f"{servo.name} forgets all that it keeps without power, {rest}: write?"
        return _confirm(command, question, lambda: reset_servo(servo, kept), "reset")


def reboot(command: RebootServo) -> int:
    """Restart a servo."""
    with open_servo(command.path, command.id, command.baud, command.protocol) as servo:
        return _report(servo.reboot(), command, "restarted")


def _confirm(
    command: ConfirmedOptions, question: str, change: Callable[[], LooseServo], done: str
) -> int:
    """Change a servo if the person agrees; return the exit code."""
    console = console_for(command)
    if not is_confirmed(console, question, yes=command.yes):
        console.print(NOT_WRITTEN)
        return DID_NOT_STAND
    return _report(change(), command, done)


def _report(servo: LooseServo, command: OneServo, text: str) -> int:
    baud = servo.bus.port.baud
    write_json({"id": servo.id, "model": servo.table.model, "baud": baud}, command)
    console_for(command).print(f"[bold green]{servo.name}[/] replies at {baud} bit/s; {text}")
    return DID_IT


# The servos of a robot ----------------------------------------------------------------------


def set_up(command: SetUpServos) -> int:
    """Set up the servos of a robot, one after the other; 1 if the person left before the end."""
    console, robot = console_for(command), load_robot(command, takes_bench=True)
    chosen = reversed(choose_joints(robot, command.joint))  # from the end of each limb
    joints = [robot.joints[i] for i in chosen]
    paths = _find_paths(robot, command.port)
    prompt = open_prompt(console, "the input ended before all servos were set up")
    if prompt is None:
        raise BadInputError("standard input is not a terminal: servo setup needs a person")
    rows = []
    for number, joint in enumerate(joints, start=1):
        where = f"{number} of {len(joints)}: connect only {name_of(joint)}"
        before = _set_up_one(robot, joint, paths[joint.name], prompt, where)
        if before is None:
            break
        (old_id, old_baud), new_id = before, joint.servo.id
        row = {"joint": joint.name, "id": new_id, "old_id": old_id, "old_baud": old_baud}
        rows.append(row)
    write_json(rows, command)
    if left := ",".join(joint.name for joint in joints[len(rows) :]):
        console.print(f"left: {left}; go on with --joint {left}")
        return DID_NOT_STAND
    number = count_of(len(rows), "servo")
    console.print(f"[bold green]set up: {number}[/]; connect all: getup doctor")
    return DID_IT


def _find_paths(robot: Robot, ports: Sequence[str]) -> dict[str, str]:
    """Find the port to which each joint's servo is connected: the only one, or its own."""
    if len(ports) == 1:
        return dict.fromkeys(robot.joint_names, ports[0].rpartition("=")[2])
    named = name_ports(robot, ports)
    return {name: named[port] for port, here in find_bus(robot).ports.items() for name in here}


def _set_up_one(
    robot: Robot, joint: Joint, path: str, prompt: Prompt, where: str
) -> tuple[int, int] | None:
    """Set up the servo of a joint, again until it works; None if the person ends it."""
    baud, name = find_bus(robot).baud, name_of(joint)
    question = f"{where}, {joint.servo.model.name}, then Enter ({QUIT} ends):"
    while prompt.ask(question).strip().lower() != QUIT:
        try:
            with open_bus(path, baud) as bus:
                before = set_up_servo(bus, robot, joint)
        except DriverError as error:
            prompt.tell(str(error))
            continue
        if before == (joint.servo.id, baud):
            prompt.tell(f"{name}: was set up already")
        else:
            old = f"was id {before[0]} at {before[1]} bit/s"
            prompt.tell(f"{name}: set up at {baud} bit/s; {old}")
        return before
    return None
