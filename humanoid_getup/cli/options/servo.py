"""Options of `getup servo`: single servos on a port."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from humanoid_getup.cli.options.hardware import ServiceOptions
from humanoid_getup.commands.backend_options import PORT_EXAMPLE, Ports
from humanoid_getup.commands.files import ROBOT
from humanoid_getup.commands.options import JsonOption
from humanoid_getup.commands.values import Range, between

ID = Range(0, 253)
Protocol = Literal["2.0", "1.0", "feetech"]
NO_PORT = f"--port is missing, expected a serial port, {PORT_EXAMPLE}"


@dataclass(frozen=True, kw_only=True)
class AnyPortOptions(JsonOption):
    """Options of all commands for servos on one port."""

    port: Annotated[str | None, arg(metavar="PATH")] = None
    """Serial port."""
    baud: Annotated[int | None, arg(metavar="BIT/S")] = None
    """Baud rate [bit/s]; default: 57600, 1, 2, 3 and 4 Mbit/s are tried until a servo replies."""
    protocol: Protocol | None = None
    """What the servos speak; default: that in which they reply."""


@dataclass(frozen=True, kw_only=True)
class ListServos(AnyPortOptions):
    """List serial ports and the devices on them with what they measure; changes nothing.

    Without a port all USB adapters are searched, and the I2C buses for IMUs.
    """

    baud: Annotated[int | None, arg(metavar="BIT/S")] = None
    """Baud rate [bit/s]; default: 57600 and 1, 2, 3 and 4 Mbit/s."""
    all_bauds: bool = False
    """Try every baud rate that a servo may have: ten seconds a port."""

    def find_problems(self) -> list[str]:
        """Report options that exclude each other as well."""
        problems = super().find_problems()
        if self.baud is not None and self.all_bauds:
            problems.append("--baud and --all-bauds exclude each other, expected one of them")
        return problems


@dataclass(frozen=True, kw_only=True)
class ServoOptions(AnyPortOptions):
    """Options of the commands that need a port."""

    def find_problems(self) -> list[str]:
        """Report a missing port as well."""
        return super().find_problems() + ([] if self.port else [NO_PORT])

    @property
    def path(self) -> str:
        """Return the port, once it is known to be given."""
        return self.port or ""


@dataclass(frozen=True, kw_only=True)
class OneServo(ServoOptions):
    """Options of the commands for one servo."""

    id: Annotated[int | None, ID, arg(metavar="ID")] = None
    """Id of the servo; default: that of the only one on the port."""


@dataclass(frozen=True, kw_only=True)
class ShowTable(OneServo):
    """Print all registers of a servo: address, size, value, unit and range; changes nothing."""


@dataclass(frozen=True, kw_only=True)
class ReadRegisters(OneServo):
    """Read registers of a servo, in counts and in units."""

    names: Annotated[Positional[tuple[str, ...]], arg(metavar="NAME...")]
    """Names of registers, see getup servo table."""

    def find_problems(self) -> list[str]:
        """Report that none is named as well."""
        named = [] if self.names else ["NAME is missing, expected a register of: getup servo table"]
        return super().find_problems() + named


@dataclass(frozen=True, kw_only=True)
class ConfirmedOptions(OneServo):
    """Options of the commands that write to what a servo keeps without power."""

    yes: bool = False
    """Do not ask before something is written that is kept without power."""


@dataclass(frozen=True, kw_only=True)
class WriteRegisters(ConfirmedOptions):
    """Write registers of a servo without torque, and read them back.

    Registers that move it are refused: getup servo move does that, guarded.
    """

    values: Annotated[Positional[tuple[str, ...]], arg(metavar="NAME=COUNTS...")]
    """Registers and their values in counts, such as temperature_limit=70."""

    def find_problems(self) -> list[str]:
        """Report that none is given as well."""
        given = [] if self.values else ["NAME=COUNTS is missing, such as temperature_limit=70"]
        return super().find_problems() + given


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


@dataclass(frozen=True, kw_only=True)
class MoveServo(JsonOption):
    """Move a servo slowly, hold it, and switch its torque off; a key stops it.

    With --robot a joint moves, within the range of its description. Without, a servo moves within
    the position limits that are stored in it, and angle 0 is the middle of its turn.
    """

    port: Ports = ()
    """Serial port; of a robot with several, NAME=PATH of each."""
    baud: Annotated[int | None, arg(metavar="BIT/S")] = None
    """Baud rate of a servo without a robot [bit/s]; default: common ones are tried."""
    protocol: Protocol | None = None
    """What a servo without a robot speaks; default: that in which it replies."""
    id: Annotated[int | None, ID, arg(metavar="ID")] = None
    """Id of the servo; default: that of the only one on the port."""
    robot: Annotated[str | None, ROBOT, arg(metavar="ROBOT")] = None
    """Name of the robot on the port, or a folder with a robot.toml."""
    joint: Annotated[str | None, arg(metavar="NAME")] = None
    """Joint of the robot."""
    to: Annotated[float | None, between(-3600.0, 3600.0, "°"), arg(metavar="°")] = None
    """Angle to move to [°]."""
    by: Annotated[float | None, between(-3600.0, 3600.0, "°"), arg(metavar="°")] = None
    """Angle to move by [°]."""
    hold: Annotated[float, between(0.0, 3600.0, "s"), arg(metavar="S")] = 1.0
    """Time for which it is held there [s]."""
    speed: Annotated[float, between(1.0, 180.0, "°/s"), arg(metavar="°/S")] = 30.0
    """Highest speed [°/s]."""
    torque_limit: Annotated[float | None, between(0.001, 1000.0, "N·m"), arg(metavar="N·m")] = None
    """Torque limit [N·m]; default: half of its stall torque."""
    yes: bool = False
    """Do not ask before something is written that the servo keeps without power."""

    def find_problems(self) -> list[str]:
        """Report what is missing, and options that exclude each other, as well."""
        problems = super().find_problems() + ([] if self.port else [NO_PORT])
        if self.robot and (self.id is not None or self.baud is not None):
            problems.append("--id and --baud are in the robot's description, expected --joint")
        elif bool(self.robot) != bool(self.joint):
            problems.append("expected --robot and --joint together, or --id without both")
        if not self.robot and len(self.port) > 1:
            problems.append(f"--port is {','.join(self.port)}, expected one serial port")
        if (self.to is None) == (self.by is None):
            problems.append("expected one of --to and --by, an angle in degrees")
        return problems


@dataclass(frozen=True, kw_only=True)
class MonitorServos(ServoOptions):
    """Show what servos measure, and the range that each has been through; changes nothing.

    Turn each servo by hand from end to end: --json keeps the ranges. q ends it.
    """

    id: Annotated[tuple[int, ...], ID, arg(metavar="ID,...")] = ()
    """Ids of the servos; default: all that reply."""
    seconds: Annotated[float | None, between(0.1, 1e6, "s"), arg(metavar="S")] = None
    """Time after which it ends [s]; default: when q is pressed."""


@dataclass(frozen=True, kw_only=True)
class SetUpServos(ServiceOptions):
    """Give the servos of a robot their ids and its baud rate, one after the other.

    Only one servo may be on the bus at a time: it is asked for by its joint. Servos that are set up
    already are left as they are, so that it can be repeated.
    """

    joint: Annotated[tuple[str, ...], arg(metavar="NAME,...")] = ()
    """Joints whose servos are set up; default: all."""
