"""Requests for benchmarks."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from humanoid_getup.jobs.output_files import find_folder_problems
from humanoid_getup.jobs.requests.files import READ, WRITTEN, Written
from humanoid_getup.jobs.requests.shared import (
    BodyOption,
    Count,
    EngineOptions,
    MotionName,
    PreferenceOptions,
    RobotOption,
    SceneOptions,
    SearchBudgetOption,
    Seed,
    TorqueOptions,
)
from humanoid_getup.jobs.requests.values import Items, at_least, between

PAGE, FIGURES, PLOT, PARTS = "benchmark.md", "benchmark.json", "benchmark.png", "parts"
ROBOTS, STARTS = "robots", "starts"
STRIPS = tuple(f"strip_{name}.png" for name in ("supine", "prone", "left", "right"))
WHOLE_ARTEFACTS = (PAGE, FIGURES, PLOT, *STRIPS)
"""Files of the whole benchmark."""
BODIES_PAGE, BODIES_FIGURES = "bodies.md", "bodies.json"
BODIES_ARTEFACTS = (BODIES_PAGE, BODIES_FIGURES)
"""Files of the benchmark over bodies."""


@dataclass(frozen=True, kw_only=True)
class BenchAll(EngineOptions, BodyOption, RobotOption):
    """Measure a robot as one page: every method under several torque caps, from the same falls."""

    n: Annotated[int | None, at_least(1)] = None
    """Falls of each class: supine, prone, left, right; default: 20, with --quick 4."""
    seed: Seed = 0
    limit_by: Literal["current", "pwm", "ideal"] | None = None
    """What the torque caps act on; default: the robot's own."""
    quick: bool = False
    """Fewer falls, torque caps and disturbances, for a first look."""
    out: Annotated[Path, Written(WHOLE_ARTEFACTS), arg(metavar="DIR")] = Path("out/benchmark")
    """Folder for benchmark.md, benchmark.json, pictures, and the results of finished parts."""
    resume: bool = False
    """Keep the finished parts in the folder; they must be of the same benchmark."""

    @property
    def each(self) -> int:
        """Return the falls of each class."""
        return self.n if self.n is not None else 4 if self.quick else 20

    def find_problems(self) -> list[str]:
        """Report a folder that cannot be written as well."""
        return super().find_problems() or find_folder_problems(self.out / PARTS, ())


@dataclass(frozen=True, kw_only=True)
class BenchBodies(EngineOptions, SearchBudgetOption):
    """Get up on the bodies of others, from their start states by their measure and from falls by
    ours, as one page beside the figures that they publish."""

    folder: Annotated[Positional[Path], arg(metavar="FOLDER")]
    """Copy of github.com/utra-robosoccer/unified-humanoid-getup."""
    bodies: Annotated[tuple[str, ...], arg(metavar="BODY,...")] = ()
    """Bodies by name; none for all seven."""
    robots: Annotated[Path | None, arg(metavar="DIR")] = None
    """Folder with a robot folder for each body; what is missing there is imported from the model.
    Default: robots in the output folder."""
    n: Count = 20
    """Falls of each class: supine, prone, left, right."""
    starts: Count = 100
    """Start states of each body."""
    seed: Seed = 0
    out: Annotated[Path, Written(BODIES_ARTEFACTS), arg(metavar="DIR")] = Path("out/bodies")
    """Folder for bodies.md, bodies.json, the imported robots, the converted start states, and the
    results of finished parts."""
    resume: bool = False
    """Keep the finished parts in the folder; they must be of the same benchmark."""

    @property
    def robots_folder(self) -> Path:
        """Return the folder with a robot folder for each body."""
        return self.out / ROBOTS if self.robots is None else self.robots

    def find_problems(self) -> list[str]:
        """Report folders that cannot be written as well."""
        folders = (self.out / PARTS, self.out / STARTS, self.robots_folder)
        found = super().find_problems()
        return found or [text for path in folders for text in find_folder_problems(path, ())]


@dataclass(frozen=True, kw_only=True)
class EngineBench(EngineOptions, RobotOption):
    """Options of a benchmark of a robot whose pieces an engine does."""


@dataclass(frozen=True, kw_only=True)
class FallsOptions(TorqueOptions, BodyOption, SceneOptions):
    """Option for the number of falls of a benchmark."""

    n: Count = 20
    """Falls of each class: supine, prone, lateral."""


@dataclass(frozen=True, kw_only=True)
class BenchRise(EngineBench, PreferenceOptions, FallsOptions):
    """Rise from many settled falls: success rates, times and faults."""

    planning: bool = True
    """Plan a collision-free path to the rising motion; otherwise interpolate."""
    filtering: bool = True
    """Filter the path through physics; otherwise play it unfiltered."""
    assistance: Annotated[float, between(0.0, 1.0)] = 1.0
    """Factor on the virtual actuator's torques in the filter; with 0, no candidate has it."""
    ledger: Annotated[Path | None, WRITTEN, arg(metavar="FILE")] = None
    """File in which every finished rise is kept, for work of hours: --resume continues with it."""
    resume: bool = False
    """Keep the finished rises of the ledger; they must be of the same benchmark."""

    def find_problems(self) -> list[str]:
        """Report a benchmark that keeps nothing to resume as well."""
        problems = super().find_problems()
        if self.resume and self.ledger is None:
            problems.append("--resume is given without --ledger, expected the file of the rises")
        return problems


@dataclass(frozen=True, kw_only=True)
class BenchMethods(EngineBench, FallsOptions):
    """Get up from the same falls by plans and by policies: success, time, load, impact, heat."""

    ways: Annotated[tuple[str, ...], READ, arg(metavar="WAY,...")] = ("plan", "robust")
    """Strategies to compare: plan, and policies by name or file."""


@dataclass(frozen=True, kw_only=True)
class BenchDisturbed(EngineBench, FallsOptions):
    """Get up in worlds that no plan knows of: loads, slopes, a step, weak servos."""

    policies: Annotated[tuple[str, ...], READ, Items(none=True), arg(metavar="POLICY,...")] = (
        "robust",
    )
    """Policies beside the plans, by name or file; '' for none."""
    cases: Annotated[tuple[str, ...], READ, arg(metavar="CASE,...")] = ()
    """Disturbances by their names in the table; default: all."""


@dataclass(frozen=True, kw_only=True)
class BenchScenes(EngineBench, BodyOption, TorqueOptions):
    """Get up in every scene by plans, policies, stored motions and straight interpolation."""

    n: Count = 20
    """Falls in each scene, evenly of the ways in which robots lie there."""
    seed: Seed = 0
    scenes: Annotated[tuple[str, ...], READ, arg(metavar="SCENE,...")] = ()
    """Names or files of scenes; none for all that are measured."""
    ways: Annotated[tuple[str, ...], READ, arg(metavar="WAY,...")] = (
        "plan",
        "robust",
        "nearest",
        "straight",
    )
    """plan; nearest: the stored motion nearest to the start; straight: straight interpolation to
    a stored motion, unfiltered; and policies by name or file."""


@dataclass(frozen=True, kw_only=True)
class BenchMotions(EngineBench, BodyOption, SceneOptions):
    """Play every motion of the database: time, load, reserve and robustness."""

    n: Count = 50
    """Number of disturbed plays of each motion."""


@dataclass(frozen=True, kw_only=True)
class BenchSit(EngineBench, BodyOption, SceneOptions):
    """Sit and lie down from disturbed stands, at full torque and under limits by PWM."""

    n: Count = 60
    """Stands; each is played under every torque limit."""


@dataclass(frozen=True, kw_only=True)
class BenchFilter(BodyOption, SceneOptions):
    """Compare the speed of the filter's simulation with bare physics."""

    n: Count = 5
    """Number of repetitions."""


@dataclass(frozen=True, kw_only=True)
class BenchFaults(EngineBench, BodyOption, SceneOptions):
    """Inject each kind of fault in the middle of a motion; exit code 1 if any was unsafe."""

    n: Count = 20
    """Number of plays of each case."""
    motion: MotionName = "supine_roll_over"
    """Name of a motion in the robot's database, an .npz file, or standing: a held stand."""


@dataclass(frozen=True, kw_only=True)
class BenchKill(BodyOption, SceneOptions):
    """Kill the program (SIGKILL) in the middle of a rise, and measure when the servos stop."""

    n: Count = 20
    """Number of kills."""
    motion: MotionName = "supine_roll_over"


@dataclass(frozen=True, kw_only=True)
class BenchSoak(BodyOption, SceneOptions):
    """Rise, hold, lie down, tumble and rise again on the virtual bus, as long as requested."""

    duration: Annotated[float, between(0.001, 1e6, "s"), arg(metavar="S")] = 1800.0
    """Time on the bus [s]."""
