"""Fields that requests share: robot, body, scene, seed, torque limit, preference."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from dataclasses import MISSING, Field, dataclass, fields, make_dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal

from tyro.conf import arg

from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.files import PICTURE, READ, ROBOT, WRITTEN, find_output_problems
from humanoid_getup.commands.values import Items, convert_value, find_value_problems, name_option
from humanoid_getup.engines.engine import Engine
from robots.storage.validation import at_least, between, hints_of

A_REAL_ROBOT = "a real robot has the body that it has"
MOST_SEED = 2**63 - 1  # that files keep exactly
Count = Annotated[int, at_least(1)]
Keys = Annotated[
    tuple[str, ...],
    READ,
    Items(twice=True),
    arg(
        metavar="FILE|half-kneel|motions:NAME@TIME,...",
        help="Postures to rise through, in order: posture files, half-kneel, or frames of motions "
        "by their times [s].",
    ),
]
MotionName = Annotated[
    str,
    READ,
    arg(metavar="MOTION", help="Name of a motion in the robot's database, or an .npz file."),
]
Origin = Annotated[
    str | None,
    READ,
    arg(
        name="from",
        metavar="supine|prone|left|right|FILE",
        help="Start of a simulated robot: class of a sampled fall, or a posture file.",
    ),
]
NO_ORIGIN = "--from is missing, expected supine, prone, left, right or a posture file"
Prefer = Literal["time", "torque", "impact", "robustness", "natural"]
PolicyName = Annotated[
    str, READ, arg(metavar="NAME|FILE", help="Name of a policy of the robot, or an .onnx file.")
]
Seed = Annotated[int, at_least(0, at_most=MOST_SEED), arg(help="Random seed.")]
TorqueLimitValue = Annotated[
    float | None,
    between(0.001, 1000.0, "N·m"),
    arg(metavar="N·m", help="Torque limit per servo [N·m]; default: stall torque."),
]
A_POLICY = "a policy is made for the original body"


@dataclass(frozen=True, kw_only=True)
class CommandRequest:
    """Base of all requests."""

    def __post_init__(self) -> None:
        """Convert texts to paths, paths to texts and lists to tuples, as the fields' types say."""
        hints = hints_of(type(self))
        for name in (field.name for field in fields(self)):
            object.__setattr__(self, name, convert_value(getattr(self, name), hints[name]))

    @classmethod
    def accept(cls, request: object) -> None:
        """Check that a request is of this kind and can be done."""
        if not isinstance(request, cls):
            is_other = isinstance(request, CommandRequest)
            given = f"a {type(request).__name__}" if is_other else repr(request)
            raise BadInputError(f"request is {given}, expected a {cls.__name__}")
        request.check()

    def find_problems(self) -> list[str]:
        """Report all problems beyond the type and range of single values."""
        return [*self._find_problems()]

    def _find_problems(self) -> Iterator[str]:
        yield from find_output_problems(self)

    def check(self) -> None:
        """Check that the request can be done."""
        if problems := find_value_problems(self) or self.find_problems():
            raise BadInputError("; ".join(problems))


@dataclass(frozen=True, kw_only=True)
class RobotOption(CommandRequest):
    """Option for the robot."""

    robot: Annotated[str, ROBOT] = "op3"
    """Name of a robot, or a folder with a robot.toml."""


@dataclass(frozen=True, kw_only=True)
class BodyOption(CommandRequest):
    """Option for the lengths of a robot's parts."""

    body: Annotated[str, arg(metavar="PART=FACTOR,...")] = ""
    """Another body of a simulated robot: factors on the lengths of shoulders, arms, torso or legs,
    such as arms=1.6,torso=2.2. Masses and inertias follow; servos stay the same."""

    def _find_problems(self) -> Iterator[str]:
        yield from super()._find_problems()
        if not self.body:
            return
        from robots import Body, BodyError  # imports numpy, which --help does without

        try:
            Body.parse(self.body)
        except BodyError as error:
            yield f"--{error}"

    def refuse_body(self, reason: str) -> list[str]:
        """Report a body for work that permits only the original one."""
        return [f"--body is {self.body}, expected none: {reason}"] if self.body else []


@dataclass(frozen=True, kw_only=True)
class LoadOption(BodyOption):
    """Options for a robot's body, and for what it holds."""

    load: Annotated[str, arg(metavar="NAME:KG,...")] = ""
    """Masses [kg] that the robot holds in left_hand, right_hand, or at a body or site of its model,
    such as left_hand:0.2. They touch nothing, and a policy does not know them."""


@dataclass(frozen=True, kw_only=True)
class SceneOptions(RobotOption):
    """Robot, scene and seed."""

    scene: Annotated[str, READ] = "flat"
    """Name of a scene, see `getup scenes`, or a scene file (.toml)."""
    seed: Seed = 0


@dataclass(frozen=True, kw_only=True)
class TorqueOptions(CommandRequest):
    """A torque limit, and what it acts on."""

    torque_limit: TorqueLimitValue = None
    limit_by: Literal["current", "pwm", "ideal"] | None = None
    """What the torque limit acts on: the motors' current, in current-based position mode; their
    PWM, in extended position mode; or, on the twin, ideally the torque; default: the robot's
    own."""


@dataclass(frozen=True, kw_only=True)
class ClipOptions(CommandRequest):
    """How the file of a clip is read."""

    rate: Annotated[float | None, between(1.0, 10_000.0, "Hz"), arg(metavar="HZ")] = None
    """Frames per second of an .amc clip [Hz], which its file does not say; default: 120."""
    unit: Annotated[str, arg(metavar="m|cm|mm|inch|METERS")] = ""
    """Unit of length of a clip, or its length [m]; default: that in which its body is as tall as a
    person."""
    up: Literal["x", "y", "z", "-x", "-y", "-z"] | None = None
    """Axis of a clip that points up; default: the one along which its body stands."""
    rename: Annotated[str, arg(metavar="FROM=TO,...")] = ""
    """Names of a clip's joints, and the known names by which they are read. What all names begin
    with is ignored."""

    def _find_problems(self) -> Iterator[str]:
        yield from super()._find_problems()
        try:
            self.reading()
        except ValueError as error:
            yield f"--{error}"

    def reading(self) -> dict[str, Any]:
        """Return the options as arguments of `read_clip`."""
        given: dict[str, Any] = {"rate": self.rate, "up": self.up}
        if self.unit:  # imports numpy, which --help does without
            from humanoid_getup.clips.layout import parse_unit

            given["unit"] = parse_unit(self.unit)
        if self.rename:
            from humanoid_getup.clips.joint_names import parse_renames

            given["renames"] = parse_renames(self.rename)
        return given


@dataclass(frozen=True, kw_only=True)
class EngineOptions(CommandRequest):
    """What runs independent pieces of work."""

    engine: Annotated[str, arg(metavar="local|dask|slurm[:N]")] = "local"
    """What does the pieces, with N workers: processes of this machine (by default as many as it has
    processors, and this process alone for a few pieces), Dask, or Dask's workers as jobs of Slurm.
    No result depends on it."""
    address: Annotated[str, arg(metavar="ADDRESS")] = ""
    """Address of a running Dask scheduler; default: a cluster on this machine, which ends with the
    work."""

    def _find_problems(self) -> Iterator[str]:
        yield from super()._find_problems()
        try:
            Engine.parse(self.engine, self.address)
        except ValueError as error:
            yield f"--{error}"


@dataclass(frozen=True, kw_only=True)
class PlannerOptions(TorqueOptions):
    """Settings of a planner."""

    search_budget: Annotated[float, between(0.001, 1e6, "s"), arg(metavar="S")] = 600.0
    """Simulated time for a search [s]. A rise that falls under some disturbance is varied until it
    stands or this is spent; one that stands is improved for up to half of it. Where no stored
    motion leads to a stand on level ground, one is searched for 20 times as long, in coarser
    physics; on a steep slope at once, for up to 50 times."""
    prefer: Prefer = "time"
    """What a planned rise should be besides successful: quick, with low torque, with small jolts
    (of the neck, not of the head alone), with a margin against disturbances, or without detours."""
    planning: bool = True
    """Plan a collision-free path to the rising motion; otherwise interpolate."""
    filtering: bool = True
    """Filter the path through physics; otherwise play it unfiltered (simulated robots only)."""

    def name_objective(self) -> str:
        """Name the options of the secondary objective that differ from their defaults."""
        given = {
            f"--prefer {self.prefer}": self.prefer != PlannerOptions.prefer,
            "--search-budget": self.search_budget != PlannerOptions.search_budget,
        }
        return " and ".join(name for name, is_given in given.items() if is_given)


JsonTarget = Annotated[
    str | None,
    WRITTEN,
    arg(metavar="FILE|-", help="Write the results as JSON to a file; - prints JSON alone."),
]


@dataclass(frozen=True, kw_only=True)
class JsonOption(CommandRequest):
    """Option for the results as JSON."""

    json: JsonTarget = None


@dataclass(frozen=True, kw_only=True)
class PictureOption(CommandRequest):
    """Option for a picture."""

    picture: Annotated[Path | None, PICTURE, arg(metavar="FILE.png")] = None
    """Picture to write."""


@cache
def with_json(request: type[CommandRequest]) -> type[CommandRequest]:
    """Return the options of a command: a request, with an option for JSON."""
    namespace = {"__doc__": request.__doc__}
    bases = (JsonOption, request)
    name = request.__name__
    return make_dataclass(name, [], bases=bases, namespace=namespace, frozen=True, kw_only=True)


Ports = Annotated[tuple[str, ...], arg(metavar="PATH|NAME=PATH,...")]
PORT_EXAMPLE = "e.g. --port /dev/ttyUSB0"
NO_PORT = f"--port is missing, expected a serial port, {PORT_EXAMPLE}"


@dataclass(frozen=True, kw_only=True)
class BackendOptions(SceneOptions):
    """The robot to which a command connects, simulated or real."""

    backend: Literal["twin", "virtual", "dynamixel"] = "twin"
    """MuJoCo twin, virtual servos on a virtual bus, or a robot with Dynamixel servos."""
    port: Ports = ()
    """Serial port; for a robot with several, NAME=PATH of each. Without it, --backend virtual
    serves a virtual robot of its own."""
    realtime: bool = False
    """Run a simulated robot in real time."""

    def _find_problems(self) -> Iterator[str]:
        yield from super()._find_problems()
        if self.backend == "twin" and self.port:
            ports = ", ".join(self.port)
            yield f"--port is {ports}, expected --backend virtual or dynamixel with it"
        if self.backend == "dynamixel" and not self.port:
            yield f"--backend dynamixel requires --port, {PORT_EXAMPLE}"

    @property
    def is_real(self) -> bool:
        """Return whether the robot may be a real one."""
        return bool(self.port)

    @property
    def is_realtime(self) -> bool:
        """Return whether cycles keep the deadlines of the wall clock."""
        return self.realtime or self.is_real


@dataclass(frozen=True, kw_only=True)
class OriginOption(BackendOptions):
    """Start of a simulated robot."""

    origin: Origin = None

    def _find_problems(self) -> Iterator[str]:
        yield from super()._find_problems()
        if self.is_real and self.origin is not None:
            yield (
                f"--from is '{self.origin}', expected a simulated robot: a real one starts as it "
                "lies"
            )


@dataclass(frozen=True, kw_only=True)
class ViewOptions(BackendOptions):
    """The robot that a command moves or reads, in a window."""

    view: bool = False
    """Show what the robot measures in MuJoCo's own viewer; a simulated one moves no faster than in
    real time."""


@dataclass(frozen=True, kw_only=True)
class ServiceOptions(JsonOption, RobotOption):
    """Options of the commands that service a robot on its bus."""

    port: Ports = ()
    """Serial port; of a robot with several, NAME=PATH of each."""

    def _find_problems(self) -> Iterator[str]:
        yield from super()._find_problems()
        if not self.port:
            yield NO_PORT


def write_command(name: str, request: CommandRequest) -> str:
    """Write the command line of a request, without defaults."""
    hints = hints_of(type(request))
    words, options = ["getup", *name.split()], list[str]()
    for field in fields(request):
        value = getattr(request, field.name)
        if value == _find_default(field):
            continue
        name = name_option(field.name, hints[field.name])
        if name.startswith("--"):
            options += _write_option(name, value)
        else:
            words += [str(item) for item in (value if isinstance(value, tuple) else (value,))]
    return shlex.join([*words, *options])


def _find_default(field: Field[Any]) -> Any:
    return None if field.default is MISSING else field.default


def _write_option(name: str, value: object) -> list[str]:
    if isinstance(value, bool):
        return [name if value else f"--no-{name[2:]}"]
    if isinstance(value, tuple):
        return [name, ",".join(map(str, value))]
    if isinstance(value, float) and value.is_integer():
        return [name, str(int(value))]
    return [name, str(value)]
