"""`getup servo id`, `baud`, `reboot`, `reset`: where a servo replies, and what it keeps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from drivers.dynamixel.protocol2 import Reset
from drivers.service.servos.loose_servo import LooseServo, open_servo
from drivers.service.servos.maintenance import (
    change_baud,
    change_id,
    check_new_baud,
    check_new_id,
    reset_servo,
)
from humanoid_getup.cli.options.servo import (
    ChangeBaud,
    ChangeId,
    ConfirmedOptions,
    OneServo,
    RebootServo,
    ResetServo,
)
from humanoid_getup.cli.shared.console import console_for
from humanoid_getup.cli.shared.exit_codes import DID_IT, DID_NOT_STAND
from humanoid_getup.cli.shared.output import write_json
from humanoid_getup.cli.shared.prompt import is_confirmed

NOT_WRITTEN = "nothing is written"
KEPT = {
    "id-and-baud": Reset.ALL_BUT_ID_AND_BAUD,
    "id": Reset.ALL_BUT_ID,
    "nothing": Reset.ALL,
}


@dataclass(frozen=True, kw_only=True)
class FoundServo:
    """Where a servo replies, for JSON."""

    id: int
    model: str
    baud: int
    """[bit/s]"""


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
        kept = command.keep.replace("-", " ")
        rest = "its id as well" if command.keep == "nothing" else f"but {kept}"
        question = f"{servo.name} forgets all that it keeps without power, {rest}: write?"
        return _confirm(command, question, lambda: reset_servo(servo, KEPT[command.keep]), "reset")


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
    write_json(FoundServo(id=servo.id, model=servo.table.model, baud=baud), command)
    console_for(command).print(f"[bold green]{servo.name}[/] replies at {baud} bit/s; {text}")
    return DID_IT
