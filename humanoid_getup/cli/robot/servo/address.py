"""`getup servo id`, `baud`, `reboot`, `reset`, `setup`: where servos reply, and what they keep."""

from __future__ import annotations

from dataclasses import asdict

from drivers.dynamixel.diagnostics import name_of
from drivers.dynamixel.protocol2 import Reset
from drivers.dynamixel.robot_bus import find_bus
from drivers.errors import DriverError
from drivers.service.servos.loose_servo import LooseServo, open_bus, open_servo
from drivers.service.servos.maintenance import (
    change_baud,
    change_id,
    check_new_baud,
    check_new_id,
    reset_servo,
)
from drivers.service.servos.motor_setup import SetUpServo, list_joints, set_up_servo
from humanoid_getup.cli.options.servo import (
    ChangeBaud,
    ChangeId,
    OneServo,
    RebootServo,
    ResetServo,
    SetUpServos,
)
from humanoid_getup.cli.shared.console import console_for
from humanoid_getup.cli.shared.exit_codes import DID_IT, DID_NOT_STAND
from humanoid_getup.cli.shared.output import write_json
from humanoid_getup.cli.shared.prompt import is_confirmed, open_prompt
from humanoid_getup.jobs.errors import BadInputError
from humanoid_getup.jobs.inputs import load_robot, name_ports

NOT_WRITTEN = "nothing is written"
KEPT = {
    "id-and-baud": Reset.ALL_BUT_ID_AND_BAUD,
    "id": Reset.ALL_BUT_ID,
    "nothing": Reset.ALL,
}
QUIT = "q"


def change_servo_id(command: ChangeId) -> int:
    """Give a servo another id; 1 if the person declined."""
    console = console_for(command)
    with open_servo(command.path, command.id, command.baud) as servo:
        check_new_id(servo, command.new)
        question = f"{servo.name} gets the id {command.new}:"
        if not is_confirmed(console, question, yes=command.yes):
            console.print(NOT_WRITTEN)
            return DID_NOT_STAND
        return _report(change_id(servo, command.new), command, f"was id {servo.id}")


def change_servo_baud(command: ChangeBaud) -> int:
    """Give a servo another baud rate; 1 if the person declined."""
    console = console_for(command)
    with open_servo(command.path, command.id, command.baud) as servo:
        check_new_baud(servo, command.new)
        before = servo.bus.port.baud
        question = f"{servo.name} changes from {before} to {command.new} bit/s:"
        if not is_confirmed(console, question, yes=command.yes):
            console.print(NOT_WRITTEN)
            return DID_NOT_STAND
        return _report(change_baud(servo, command.new), command, f"was at {before} bit/s")


def reboot(command: RebootServo) -> int:
    """Restart a servo."""
    with open_servo(command.path, command.id, command.baud) as servo:
        return _report(servo.reboot(), command, "restarted")


def reset(command: ResetServo) -> int:
    """Set a servo to the values as shipped; 1 if the person declined."""
    console = console_for(command)
    with open_servo(command.path, command.id, command.baud) as servo:
        kept = command.keep.replace("-", " ")
        question = f"{servo.name} forgets all that it keeps without power but {kept}:"
        if command.keep == "nothing":
            question = f"{servo.name} forgets all that it keeps without power, its id as well:"
        if not is_confirmed(console, question, yes=command.yes):
            console.print(NOT_WRITTEN)
            return DID_NOT_STAND
        return _report(reset_servo(servo, KEPT[command.keep]), command, "reset")


def set_up(command: SetUpServos) -> int:
    """Set up the servos of a robot, one after the other; 1 if the person left before the end."""
    console, robot = console_for(command), load_robot(command, takes_bench=True)
    joints = list_joints(robot, command.joint)
    if len(command.port) == 1 and "=" not in command.port[0]:
        path = command.port[0]
    else:
        path = next(iter(name_ports(robot, command.port).values()))
    baud = find_bus(robot).baud
    prompt = open_prompt(console, "the input ended before all servos were set up")
    if prompt is None:
        raise BadInputError("standard input is not a terminal: servo setup needs a person")
    done: list[SetUpServo] = []
    for number, joint in enumerate(joints, start=1):
        where = (
            f"{number} of {len(joints)}: connect only {name_of(joint)}, {joint.servo.model.name}"
        )
        while len(done) < number:
            if prompt.ask(f"{where}, then Enter ({QUIT} ends):").strip().lower() == QUIT:
                break
            try:
                with open_bus(path, baud) as bus:
                    done.append(set_up_servo(bus, robot, joint))
            except DriverError as error:
                prompt.tell(str(error))
                continue
            prompt.tell(_describe(done[-1], baud))
        else:
            continue
        break
    write_json([asdict_of(servo) for servo in done], command)
    left = [joint.name for joint in joints[len(done) :]]
    if left:
        console.print(f"left: {', '.join(left)}; go on with --joint {','.join(left)}")
        return DID_NOT_STAND
    console.print(f"[bold green]{len(done)} servos[/] are set up; connect all: getup doctor")
    return DID_IT


def asdict_of(servo: SetUpServo) -> dict[str, object]:
    """Describe a servo that was set up, for JSON."""
    values = asdict(servo)
    values["joint"] = servo.joint.name
    values["id"] = servo.joint.servo.id
    return values


def _describe(servo: SetUpServo, baud: int) -> str:
    if not servo.is_changed(baud):
        return f"{name_of(servo.joint)}: was set up already"
    return (
        f"{name_of(servo.joint)}: set up at {baud} bit/s; was id {servo.old_id} at "
        f"{servo.old_baud} bit/s"
    )


def _report(servo: LooseServo, command: OneServo, text: str) -> int:
    baud = servo.bus.port.baud
    write_json({"id": servo.id, "model": servo.table.model, "baud": baud}, command)
    console_for(command).print(f"[bold green]{servo.name}[/] replies at {baud} bit/s; {text}")
    return DID_IT
