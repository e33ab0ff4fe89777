"""Options that commands share."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from tyro.conf import arg

from humanoid_getup.cli.checks import at_least, positive
from humanoid_getup.cli.output import find_folder_faults, find_json_faults

CacheFolder = Annotated[
    Path | None,
    arg(metavar="DIR", help="Folder of the plan cache; default: in the user's cache folder."),
]
Count = Annotated[int, at_least(1)]
JsonTarget = Annotated[
    str | None,
    arg(metavar="FILE|-", help="Write the results as JSON to a file; - prints JSON alone."),
]
Keys = Annotated[
    tuple[str, ...],
    arg(
        metavar="FILE|motions:NAME@TIME,...",
        help="Postures to rise through, in order: posture files, or frames of motions by their "
        "times [s].",
    ),
]
MotionName = Annotated[
    str,
    arg(metavar="MOTION", help="Name of a motion in the robot's database, or an .npz file."),
]
Origin = Annotated[
    str | None,
    arg(
        name="from",
        metavar="supine|prone|left|right|FILE",
        help="Start of a simulated robot: class of a sampled fall, or a posture file.",
    ),
]
NO_ORIGIN = "--from is missing, expected supine, prone, left, right or a posture file"
Prefer = Literal["time", "torque", "impact", "robustness"]
PolicyName = Annotated[
    str, arg(metavar="NAME|FILE", help="Name of a policy of the robot, or an .onnx file.")
]
Ports = Annotated[tuple[str, ...], arg(metavar="PATH|NAME=PATH,...")]
PORT_EXAMPLE = "e.g. --port /dev/ttyUSB0"
StyleOption = Annotated[
    str | None,
    arg(
        metavar="STYLE|planned",
        help="What a policy that follows style curves follows: a style, see `getup style list`, a "
        "style file, or the curves of a motion that is planned; default: of the styles that begin "
        "nearest to the robot, the one that turns it least.",
    ),
]
Seed = Annotated[int, at_least(0), arg(help="Random seed.")]
TorqueLimitValue = Annotated[
    float | None,
    positive("N·m"),
    arg(metavar="N·m", help="Torque limit per servo [N·m]; default: stall torque."),
]


@dataclass(frozen=True, kw_only=True)
class CommandOptions:
    """Options of a command."""

    def find_faults(self) -> list[str]:
        """Report all that is wrong beyond the type and range of single values."""
        return []


A_REAL_ROBOT = "a real robot has the body that it has"
A_POLICY = "a policy is made for the original body"


@dataclass(frozen=True, kw_only=True)
class RobotOption(CommandOptions):
    """Which robot."""

    robot: str = "op3"
    """Name of a robot, or a folder with a robot.toml."""


@dataclass(frozen=True, kw_only=True)
class BodyOption(CommandOptions):
    """The lengths of a robot's parts."""

    body: Annotated[str, arg(metavar="PART=FACTOR,...")] = ""
    """Another body of a simulated robot: factors on the lengths of shoulders, arms, torso or legs,
    such as arms=1.6,torso=2.2. Masses and inertias follow; servos stay the same."""

    def find_faults(self) -> list[str]:
        """Report a body that cannot be, too."""
        faults = super().find_faults()
        if not self.body:
            return faults
        from robots import Body, BodyError  # imports numpy, which --help does without

        try:
            Body.parse(self.body)
        except BodyError as error:
            faults.append(f"--{error}")
        is_real = isinstance(self, BackendOptions) and self.backend == "dynamixel"
        return faults + (self.refuse_body(A_REAL_ROBOT) if is_real else [])

    def refuse_body(self, reason: str) -> list[str]:
        """Report a body where only the original one will do."""
        return [f"--body is {self.body}, expected none: {reason}"] if self.body else []


@dataclass(frozen=True, kw_only=True)
class JsonOption(CommandOptions):
    """Where the results go."""

    json: JsonTarget = None

    def find_faults(self) -> list[str]:
        """Report a file that cannot be written."""
        return super().find_faults() + find_json_faults(self.json)


@dataclass(frozen=True, kw_only=True)
class SceneOptions(RobotOption):
    """Robot, scene and seed."""

    scene: str = "flat"
    """Name of a scene, see `getup scenes`, or a scene file (.toml)."""
    seed: Seed = 0


@dataclass(frozen=True, kw_only=True)
class WorldOptions(BodyOption, JsonOption, SceneOptions):
    """Robot, body, scene, seed, and where the results go."""


@dataclass(frozen=True, kw_only=True)
class TorqueOptions(CommandOptions):
    """A torque limit, and what it acts on."""

    torque_limit: TorqueLimitValue = None
    limit_by: Literal["current", "pwm", "ideal"] | None = None
    """What the torque limit acts on: the motors' current, in current-based position mode; their
    PWM, in position mode; or, on the twin, ideally the torque; default: the robot's own."""


@dataclass(frozen=True, kw_only=True)
class PreferenceOptions(CommandOptions):
    """What a planned rise should be, and how long it is searched for."""

    prefer: Prefer = "time"
    """What a planned rise should be besides successful: quick, with low torque, with small jolts
    (of the neck, not of the head alone), or with a margin against disturbances."""
    search_budget: Annotated[float, positive("s", at_most=1e6), arg(metavar="S")] = 600.0
    """Simulated time for a search [s]. A rise that falls under some disturbance is varied until it
    stands or this is spent; one that stands is improved, as --prefer says, for up to half of it."""


@dataclass(frozen=True, kw_only=True)
class BackendOptions(SceneOptions):
    """Which robot a command connects to, simulated or real."""

    backend: Literal["twin", "virtual", "dynamixel"] = "twin"
    """MuJoCo twin, virtual servos on a virtual bus, or a robot with Dynamixel servos."""
    port: Ports = ()
    """Serial port; for a robot with several, NAME=PATH of each. Without it, --backend virtual
    serves a virtual robot of its own."""
    realtime: bool = False
    """Run a simulated robot in real time."""

    def find_faults(self) -> list[str]:
        """Report ports that do not fit, too."""
        faults = super().find_faults()
        if self.backend == "twin" and self.port:
            ports = ", ".join(self.port)
            faults.append(f"--port is {ports}, expected --backend virtual or dynamixel with it")
        if self.backend == "dynamixel" and not self.port:
            faults.append(f"--backend dynamixel requires --port, {PORT_EXAMPLE}")
        return faults

    @property
    def is_real(self) -> bool:
        """Whether the robot may be a real one."""
        return bool(self.port)


@dataclass(frozen=True, kw_only=True)
class MoveOptions(TorqueOptions, JsonOption, BackendOptions):
    """Options of every command that moves a robot."""

    out: Annotated[Path | None, arg(metavar="DIR")] = None
    """Folder for report.json, motion.npz, flight.mcap, and the pictures strip.png, torque.png and,
    of a policy with style curves, style.png."""

    def find_faults(self) -> list[str]:
        """Report a torque limit or a folder that does not fit, too."""
        faults = super().find_faults()
        if self.backend != "twin" and self.limit_by == "ideal":
            faults.append("--limit-by is ideal, which no servo can, expected current or pwm")
        if self.out is not None:
            faults += find_folder_faults(self.out)
        return faults


@dataclass(frozen=True, kw_only=True)
class RunOptions(MoveOptions):
    """Options of every command that gets a robot up."""

    then: Literal["hold", "sit", "limp", "hand-over"] | None = None
    """After a judged stand: hold it until a key is pressed, then sit and lie down (in simulated
    time or without a terminal: at once); sit and lie down at once; torque off where it stands; or
    leave torque on for another program. Default: hold; of the twin, limp."""
    balance: bool = True
    """Feed the torso's attitude back to the ankles while the robot rises and stands."""
    at: Annotated[tuple[float, float, float] | None, arg(metavar="X,Y,DEG")] = None
    """Where in its scene a real robot lies: its torso [m], and the direction in which its head
    points, from +x [deg]."""
    origin: Origin = None
    needs_origin: ClassVar[bool] = True
    """Whether a simulated robot has no start of its own."""

    def find_faults(self) -> list[str]:
        """Report a start that does not fit, too."""
        faults = super().find_faults()
        if self.at is not None and not all(math.isfinite(value) for value in self.at):
            faults.append(f"--at is {self.at}, expected three finite numbers")
        if self.at is not None and not self.is_real:
            faults.append("--at is given, expected a real robot: a simulated one knows its place")
        if self.is_real and self.at is None and self.scene != "flat":
            faults.append(f"--scene {self.scene} on a real robot requires --at X,Y,DEG")
        if self.is_real and self.origin is not None:
            faults.append(
                f"--from is '{self.origin}', expected a simulated robot: a real one starts as it "
                "lies"
            )
        is_simulated = self.backend != "dynamixel"
        if self.needs_origin and is_simulated and not self.is_real and self.origin is None:
            faults.append(NO_ORIGIN)
        return faults

    @property
    def ending(self) -> Literal["hold", "sit", "limp", "hand-over"]:
        """What follows a judged stand."""
        return self.then or ("limp" if self.backend == "twin" else "hold")
