"""Options of the command line alone: output of results, and backends."""

from __future__ import annotations

import math
from dataclasses import dataclass, make_dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from tyro.conf import arg

from humanoid_getup.cli.shared.output import ARTEFACTS
from humanoid_getup.jobs.requests.files import READ, WRITTEN, Written
from humanoid_getup.jobs.requests.shared import (
    NO_ORIGIN,
    BodyOption,
    JobRequest,
    Origin,
    SceneOptions,
    TorqueOptions,
)

CacheFolder = Annotated[
    Path | None,
    arg(metavar="DIR", help="Folder of the plan cache; default: in the user's cache folder."),
]
JsonTarget = Annotated[
    str | None,
    WRITTEN,
    arg(metavar="FILE|-", help="Write the results as JSON to a file; - prints JSON alone."),
]
Ports = Annotated[tuple[str, ...], arg(metavar="PATH|NAME=PATH,...")]
PORT_EXAMPLE = "e.g. --port /dev/ttyUSB0"
StyleOption = Annotated[
    str | None,
    READ,
    arg(
        metavar="STYLE|planned",
        help="Style that a policy with style curves follows: a name, see `getup style list`, a "
        "style file, or planned for the curves of a planned motion; default: of the styles that "
        "begin nearest to the robot, the one that turns it least.",
    ),
]
A_REAL_ROBOT = "a real robot has the body that it has"


@dataclass(frozen=True, kw_only=True)
class JsonOption(JobRequest):
    """Option for the results as JSON."""

    json: JsonTarget = None


@dataclass(frozen=True, kw_only=True)
class PictureOption(JobRequest):
    """Option for a picture."""

    picture: Annotated[Path | None, WRITTEN, arg(metavar="FILE.png")] = None
    """Picture to write."""


@dataclass(frozen=True, kw_only=True)
class WorldOptions(BodyOption, JsonOption, SceneOptions):
    """Robot, body, scene, seed, and the results as JSON."""


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

    def find_problems(self) -> list[str]:
        """Report wrong ports as well."""
        problems = super().find_problems()
        if self.backend == "twin" and self.port:
            ports = ", ".join(self.port)
            problems.append(f"--port is {ports}, expected --backend virtual or dynamixel with it")
        if self.backend == "dynamixel" and not self.port:
            problems.append(f"--backend dynamixel requires --port, {PORT_EXAMPLE}")
        return problems

    @property
    def is_real(self) -> bool:
        """Return whether the robot may be a real one."""
        return bool(self.port)


@dataclass(frozen=True, kw_only=True)
class MoveOptions(TorqueOptions, JsonOption, BackendOptions):
    """Options of every command that moves a robot."""

    out: Annotated[Path | None, Written(ARTEFACTS), arg(metavar="DIR")] = None
    """Folder for report.json, motion.npz, flight.mcap, and the pictures strip.png, torque.png and,
    of a policy with style curves, style.png."""

    def find_problems(self) -> list[str]:
        """Report a wrong torque limit or body as well."""
        problems = super().find_problems()
        if self.backend != "twin" and self.limit_by == "ideal":
            problems.append("--limit-by is ideal, which no servo can, expected current or pwm")
        if self.backend == "dynamixel" and isinstance(self, BodyOption):
            problems += self.refuse_body(A_REAL_ROBOT)
        return problems


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

    def find_problems(self) -> list[str]:
        """Report a wrong start as well."""
        problems = super().find_problems()
        if self.at is not None and not all(math.isfinite(value) for value in self.at):
            problems.append(f"--at is {self.at}, expected three finite numbers")
        if self.at is not None and not self.is_real:
            problems.append("--at is given, expected a real robot: a simulated one knows its place")
        if self.is_real and self.at is None and self.scene != "flat":
            problems.append(f"--scene {self.scene} on a real robot requires --at X,Y,DEG")
        if self.is_real and self.origin is not None:
            problems.append(
                f"--from is '{self.origin}', expected a simulated robot: a real one starts as it "
                "lies"
            )
        is_simulated = self.backend != "dynamixel"
        if self.needs_origin and is_simulated and not self.is_real and self.origin is None:
            problems.append(NO_ORIGIN)
        return problems

    @property
    def ending(self) -> Literal["hold", "sit", "limp", "hand-over"]:
        """What follows a judged stand."""
        return self.then or ("limp" if self.backend == "twin" else "hold")


@cache
def with_json(request: type[JobRequest]) -> type[JobRequest]:
    """Return the options of a command: a request, with an option for JSON."""
    namespace = {"__doc__": request.__doc__}
    bases = (JsonOption, request)
    name = request.__name__
    return make_dataclass(name, [], bases=bases, namespace=namespace, frozen=True, kw_only=True)
