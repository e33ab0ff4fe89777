"""What the scripts share: options, pieces of work on an engine, a table, and JSON."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import parent_process
from pathlib import Path
from typing import Any, TypeVar

from humanoid_getup.benchmarks.rise import MeasuredRise
from humanoid_getup.commands.console import console_for, format_figure, make_bars, make_table
from humanoid_getup.engines.executor import do_pieces as run_pieces
from humanoid_getup.engines.executor import make_executor
from humanoid_getup.engines.versions import checked
from humanoid_getup.execution.rise import Rise
from humanoid_getup.experiments.judging.summary import RiseSummary
from humanoid_getup.progress.ledger import Ledger
from humanoid_getup.scenes.named_scenes import load_scene
from humanoid_getup.simulation.world import World
from robots import Body, Robot, TorqueLimit, load_robot
from robots.servo import LimitMode
from robots.storage.encoding import to_json
from robots.storage.files import write_atomically

WIDTH = 200  # characters of a table that goes to no terminal
LOAD_FIGURES = ("stand_time_s", "peak_torque_nm", "rms_torque_nm")
RISE_FIGURES = ("n", "planned", "stood", "stood_interval_95", *LOAD_FIGURES)
"""Figures of a table of rises."""
Piece = TypeVar("Piece")
Result = TypeVar("Result")


@contextmanager
def counting(what: str, total: float) -> Iterator[Callable[[float], None]]:
    """Show a progress bar on standard error; yield what advances it."""
    with make_bars() as bars:
        bar = bars.add_task(what, total=total, note="")
        yield lambda done: bars.advance(bar, done)


@dataclass(frozen=True, kw_only=True)
class WorkOptions:
    """Seed, engine, and a file for the figures."""

    seed: int = 0
    engine: str = "local"
    """What does the pieces, such as local:2 or dask; no figure but times depends on it."""
    address: str = ""
    """Address of a running Dask scheduler."""
    json: Path | None = None
    """File for all figures."""

    @property
    def threads(self) -> int:
        """Return the threads that step the physics here; 0 for one per processor."""
        return 0 if parent_process() is None else 1


@dataclass(frozen=True, kw_only=True)
class Options(WorkOptions):
    """Also a robot in a scene."""

    robot: str = "op3"
    """Name of a robot, or a folder with a robot.toml."""
    body: str = ""
    """Factors on the lengths of its parts, such as arms=1.6,torso=2.2."""
    scene: str = "flat"
    """Name of a scene, or a scene file."""

    def load_robot(self) -> Robot:
        """Load the robot with its body."""
        return load_robot(self.robot, Body.parse(self.body))

    def load_world(self) -> World:
        """Load the robot into its scene."""
        robot = self.load_robot()
        return World(robot, load_scene(self.scene, robot, self.seed))

    def describe(self, name: str, n: int) -> dict[str, Any]:
        """Describe what was measured, to stand before its figures."""
        robot = self.load_robot()
        head = {"name": name, "seed": self.seed, "n": n, "robot": robot.name}
        return head | {"body": str(robot.body), "scene": self.scene}


@dataclass(frozen=True, kw_only=True)
class LimitedOptions(Options):
    """Also a torque limit."""

    torque_limit: float | None = None
    """Of every servo [N·m]; default: stall torque."""
    limit_by: LimitMode | None = None
    """What the limit acts on; default: the robot's own."""

    def make_limit(self, robot: Robot) -> TorqueLimit:
        """Make the torque limit of a robot."""
        return TorqueLimit(self.torque_limit, self.limit_by).on(robot)

    def describe(self, name: str, n: int) -> dict[str, Any]:
        """Describe what was measured, with its torque limit."""
        limit = self.make_limit(self.load_robot())
        head = super().describe(name, n)
        return head | {"torque_limit_nm": limit.value, "limit_by": limit.by}


def do_pieces(
    work: Callable[[Piece], Result],
    pieces: Sequence[Piece],
    options: WorkOptions,
    *,
    ledger: Ledger | None = None,
    kind: Any = Any,
) -> list[Result]:
    """Do pieces on the engine; return the results in the order of the pieces.

    A ledger keeps each result under the text of its piece; those that it holds, of a kind, are not
    done again.
    """
    names = [str(piece) if ledger else str(k) for k, piece in enumerate(pieces)]
    named = dict(zip(names, pieces, strict=True))
    with (
        counting("pieces", len(named)) as count,
        make_executor(options.engine, options.address, pieces=len(named)) as executor,
    ):
        found = run_pieces(
            checked(work, executor),
            named,
            executor,
            ledger=ledger,
            kind=kind,
            ended=lambda *_: count(1),
        )
    return list(found.values())


@dataclass(frozen=True, kw_only=True)
class RefusableRise(MeasuredRise):
    """A rise that the preflight may have refused."""

    way: str
    case: str
    fall: int
    """Number of the fall."""
    refused: bool
    """Whether nothing was played."""

    @classmethod
    def of(cls, rise: Rise, *, case: str, way: str, fall: int) -> RefusableRise:
        """Label a rise."""
        refused = rise.run is None
        return cls(**vars(rise.figures()), case=case, way=way, fall=fall, refused=refused)


class RefusableSummary(RiseSummary, frozen=True, kw_only=True):
    """Rises of which the preflight may refuse some."""

    refused: int
    failures: list[str]
    """Fall and reason of each rise that did not stand."""

    @classmethod
    def table(
        cls, rises: Sequence[RefusableRise], cases: Iterable[str], ways: Sequence[str]
    ) -> dict[str, RefusableSummary]:
        """Summarize the rises of each case by each way."""
        return {f"{case}: {way}": cls._select(rises, case, way) for case in cases for way in ways}

    @classmethod
    def _select(cls, rises: Sequence[RefusableRise], case: str, way: str) -> RefusableSummary:
        ours = [rise for rise in rises if rise.case == case and rise.way == way]
        return cls.of(
            ours,
            refused=sum(rise.refused for rise in ours),
            failures=[f"fall {rise.fall}: {rise.reason}" for rise in ours if not rise.stood],
        )


def write_results(result: dict[str, Any], figures: Sequence[str], json: Path | None) -> None:
    """Print figures of every case as a table, and write all results as JSON if a file is named."""
    rows = []
    for name, case in result["cases"].items():
        values = case if isinstance(case, dict) else {key: getattr(case, key) for key in figures}
        rows.append((name, *(values[key] for key in figures)))
    print_table((result["name"], *figures), rows)
    if json is not None:
        write_atomically(json, to_json(result))


def print_table(headings: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
    """Print figures as a table; the first column names them."""
    table = make_table(headings, left=headings[:1])
    for row in rows:
        table.add_row(*map(format_figure, row))
    console = console_for()
    if not console.is_terminal:
        console.width = WIDTH
    console.print(table)
