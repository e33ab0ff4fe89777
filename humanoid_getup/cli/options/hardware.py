"""Options of `getup bus`, `doctor` and `calibrate`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import arg

from humanoid_getup.commands.backend_options import PORT_EXAMPLE, Ports
from humanoid_getup.commands.files import FOLDER, READ
from humanoid_getup.commands.options import (
    BodyOption,
    JsonOption,
    PictureOption,
    RobotOption,
    SceneOptions,
)
from humanoid_getup.commands.values import Items, between
from humanoid_getup.jobs.requests.robots import CheckRequest


@dataclass(frozen=True, kw_only=True)
class ListRobots(JsonOption):
    """List the robots that come with the program."""


@dataclass(frozen=True, kw_only=True)
class CheckRobot(PictureOption, JsonOption, CheckRequest):
    """Check whether a robot's description is sound and its body able to get up; one finding a
    line, each with what to do. The picture is of the stance and of the deepest squat."""


@dataclass(frozen=True, kw_only=True)
class ServeBus(BodyOption, SceneOptions):
    """Serve a virtual bus with a simulated robot behind it, until stopped.

    Prints the path of the serial port; of a robot with several, one line each, and one for an IMU
    on a line of its own: PATH-imu with --link PATH, a serial port or the socket of an I2C bus.
    Behind it are, with --servos, servos on a bench instead of a robot. What is typed meanwhile, a
    person at the robot does: hold zero, turn l_knee:20, let go, lay prone.
    """

    servos: Annotated[
        tuple[str, ...], Items(twice=True), arg(metavar="MODEL:ID,ID,MODEL:ID,...")
    ] = ()
    """Servos on a bench instead of a robot: each model with its ids, such as
    XL430-W250:1,2,XM430-W350:3."""
    load: Annotated[str | None, arg(metavar="KG:M")] = None
    """Mass that hangs from each horn on a bench, and its distance; default: none."""
    baud: Annotated[int | None, arg(metavar="BIT/S")] = None
    """Baud rate of the bus [bit/s]; default: the robot's, or 57600 on a bench, as servos are
    shipped."""

    origin: Annotated[str, READ, arg(name="from", metavar="supine|prone|left|right|FILE")] = (
        "supine"
    )
    """Initial posture: class of a sampled fall, or a posture file."""
    link: Annotated[Path | None, arg(metavar="PATH")] = None
    """Path of the port; default: in a temporary folder."""
    hold: Annotated[str | None, READ, arg(metavar="zero|standing|FILE")] = None
    """Posture in which a person holds the robot, instead of a fall: torso and joints without torque
    stay; servos with torque move theirs."""
    turn: Annotated[tuple[str, ...], arg(metavar="JOINT:DEG,...")] = ()
    """Joints that the person turns, each by an angle [°]; with --hold."""
    lock_step: bool = False
    """Advance time with the client's sync writes of goals instead of the clock."""
    faults: Annotated[Path | None, READ, arg(metavar="FILE")] = None
    """TOML file of faults to inject."""
    powered: bool = False
    """Start with servo power on; without it, a client must switch it on at the board."""
    voltage: Annotated[float | None, between(1.0, 48.0, "V"), arg(metavar="V")] = None
    """Supply [V]; default: the robot's nominal voltage."""
    latency: Annotated[float, between(0.0, 0.1, "s"), arg(metavar="S")] = 0.0
    """Latency timer of the USB adapter [s]; FTDI adapters: 0.016 as shipped."""

    def find_problems(self) -> list[str]:
        """Report a load without a bench as well."""
        problems = super().find_problems()
        if self.load is not None and not self.servos:
            problems.append("--load needs --servos: it hangs from the servos of a bench")
        if self.turn and self.hold is None:
            problems.append("--turn needs --hold: a person turns joints of a robot that is held")
        return problems


@dataclass(frozen=True, kw_only=True)
class ServiceOptions(JsonOption, RobotOption):
    """Options of the commands that service a robot on its bus."""

    port: Ports = ()
    """Serial port; of a robot with several, NAME=PATH of each."""

    def find_problems(self) -> list[str]:
        """Report missing ports as well."""
        missing = f"--port is missing, expected a serial port, {PORT_EXAMPLE}"
        return super().find_problems() + ([] if self.port else [missing])


@dataclass(frozen=True, kw_only=True)
class Doctor(ServiceOptions):
    """Check a robot on its bus before first torque; moves nothing."""


@dataclass(frozen=True, kw_only=True)
class Calibrate(ServiceOptions):
    """Measure the servos' zeros and directions, torque off.

    The result is the robot's calibration.toml, or calibration.virtual.toml beside it if a port
    is a pseudo-terminal, as of a virtual bus: a trial run leaves the robot's file alone.
    """

    at: Annotated[str | None, READ, arg(metavar="zero|standing|FILE")] = None
    """Posture in which the robot is held while its zeros are measured: all angles 0, its stance,
    or a posture file; default: zero, and with --signs alone no zeros are measured."""
    joint: Annotated[tuple[str, ...], arg(metavar="NAME,...")] = ()
    """Joints to calibrate; default: all."""
    signs: bool = False
    """Measure the servos' directions: a person turns one joint after the other."""
    yes: bool = False
    """Do not ask before torque goes off, before zeros are measured, or before saving."""
    out: Annotated[Path | None, arg(metavar="FILE")] = None
    """Calibration file to write; default: see above."""


@dataclass(frozen=True, kw_only=True)
class FirstSteps(ServiceOptions):
    """Lead from a port to the first rise: each step is a command, shown, and run after Enter.

    What is done is kept, so that the next start goes on where this one ended.
    """

    desk: bool = False
    """Loose servos on a desk instead of a robot."""
    torque_limit: Annotated[float | None, between(0.001, 1000.0, "N·m"), arg(metavar="N·m")] = None
    """Torque limit per servo of the first rise [N·m]; default: 60 % of the stall torque of the
    strongest."""
    out: Annotated[Path | None, FOLDER, arg(metavar="DIR")] = None
    """Folder for what is done, reports and flight logs; default: out/first-steps/ROBOT."""
