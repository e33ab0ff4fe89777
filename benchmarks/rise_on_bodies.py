"""Get up on the bodies of others, from their start states and from falls, by both measures.

    git clone https://github.com/utra-robosoccer/unified-humanoid-getup
    python benchmarks/rise_on_bodies.py unified-humanoid-getup --json bodies.json

What is missing in the folder of robots is imported from the makers' models. Without motions, every
plan is counted as one that does not stand: `getup motions discover --robot out/bodies/NAME`. Their
measure: the head is within 20 % of its standing height above the middle of the feet, after 5 s, and
at the end, however late.
"""

from __future__ import annotations

import pickle
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from pathlib import Path
from typing import Annotated, Any

import mujoco
import numpy as np
import tyro
from msgspec.structs import asdict
from script import LOAD_FIGURES, WorkOptions, do_pieces, write_results

from drivers import Ending, Twin
from humanoid_getup.benchmarks.rise import MeasuredRise, rise_once
from humanoid_getup.benchmarks.whole import sample_by_class
from humanoid_getup.commands.robot.import_robot import ImportRequest, import_robot
from humanoid_getup.engines.versions import hash_folder, hash_program
from humanoid_getup.execution.rise import Rise
from humanoid_getup.execution.session import SessionOptions
from humanoid_getup.experiments.falls import UNCLASSED, Fall, classify, find_rest
from humanoid_getup.experiments.judging.summary import RiseSummary, wilson_interval
from humanoid_getup.motions.motion_database import list_motions
from humanoid_getup.planning.planner_settings import DEFAULTS, PlannerSettings
from humanoid_getup.policy.onnx_policy import list_policies
from humanoid_getup.progress.ledger import Ledger
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.choice import PLAN, make_strategy
from humanoid_getup.strategies.plan import Plan, RiseStatus, Strategy
from robots import FULL_TORQUE, Posture, TorqueLimit, load_robot, quaternion
from robots.model_import.importer import read_model
from robots.quaternion import Array

PACKAGE = "unified_humanoid_get_up_env"
HEADS = {
    "bez1": 0.4808,
    "bez2": 0.54,
    "bez3": 0.62,
    "nugus": 0.8087,
    "op3_rot": 0.492,
    "sigmaban": 0.67,
    "wolfgang": 0.7673,
}
"""Height of each standing robot's head above the middle of its feet [m], of standup_env.py."""
HEAD, FEET = "camera", ("left_foot", "right_foot")
"""Sites of the models whose heights are compared."""
STARTS, FALLS = "their starts", "falls"
"""Kinds of starts: states of a body's makers, and falls with random joints."""
TOLERANCE = 0.2  # share of the standing height by which a standing robot's head may be off
TIME_LIMIT = 5.0  # s, of an episode of the makers
APART = 0.002  # m by which a site may be elsewhere in the imported robot
FIGURES = ("n", "stood", "stood_interval_95", "head_in_time", "head_at_end", *LOAD_FIGURES)


@dataclass(frozen=True, kw_only=True)
class BodyOptions(WorkOptions):
    """Options of this script."""

    folder: Annotated[Path, tyro.conf.Positional]
    """Copy of github.com/utra-robosoccer/unified-humanoid-getup."""
    robots: Path = Path("out/bodies")
    """Folder with a robot folder for each body."""
    bodies: tuple[str, ...] = tuple(HEADS)
    """Bodies by name."""
    n: int = 20
    """Falls of each class: supine, prone, left, right."""
    starts: int = 100
    """Start states of each body."""
    search_budget: float = DEFAULTS.search_budget
    """Simulated time in which the search of a plan may vary it [s]."""
    ledger: Path | None = None
    """File that keeps finished rises; an interrupted run continues with it."""


@dataclass(frozen=True, kw_only=True)
class Piece:
    """A rise on a body from one of its starts."""

    body: str
    way: str
    kind: str
    number: int
    fall: Fall

    def __str__(self) -> str:
        return f"{self.body}: {self.way}, {self.kind} {self.number + 1}"


@dataclass(frozen=True, kw_only=True)
class BodyRise(MeasuredRise):
    """Figures of a rise, also by the measure of the makers."""

    head_in_time: bool
    """Whether the head was as high as a standing robot's at the time limit."""
    head_at_end: bool
    """The same at the end, however late."""
    head_share: float | None
    """Height of the head at the end as a share of the standing one; None if nothing was played."""


@dataclass(frozen=True, kw_only=True)
class NoMotions:
    """The plan of a robot that has no motions: nothing."""

    world: World
    torque_limit: TorqueLimit = FULL_TORQUE

    def plan(self, _start: Posture, _rng: np.random.Generator) -> Plan:
        """Return a plan with nothing to play."""
        return Plan(status=RiseStatus.NOT_PLANNED, detail="the robot has no motions")


class BenchedBody:
    """A body of others as a robot of ours."""

    def __init__(self, options: BodyOptions, name: str) -> None:
        """Load a body by name; import its robot if there is none."""
        package, robot = options.folder / PACKAGE, options.robots / name
        model = package / "mujoco_simulator" / "model" / f"{name}.xml"
        self.pickled = package / "env" / name / "standup_initial_configurations.pkl"
        if not (robot / "robot.toml").exists():
            import_robot(ImportRequest(model=model, out=robot))
        self.name, self._options = name, options
        self.source, self.world = read_model(model).model, World(load_robot(robot))
        self.has_motions = bool(list_motions(self.world.robot))
        self.ways = (PLAN, *(file.stem for file in list_policies(self.world.robot)))

    @cached_property
    def gauge(self) -> HeadGauge:
        """Make the gauge of its head."""
        return HeadGauge(self.source, self.world.model, HEADS[self.name])

    @cached_property
    def strategies(self) -> dict[str, Strategy]:
        """Make its strategies."""
        found, options = dict[str, Strategy](), self._options
        settings = PlannerSettings(search_budget=options.search_budget, threads=options.threads)
        for way in self.ways:
            found[way] = NoMotions(world=self.world)
            if way != PLAN or self.has_motions:
                found[way] = make_strategy(self.world, way, settings)
        return found

    def list_pieces(self) -> Iterator[Piece]:
        """List the rises, from the same starts in every way."""
        options = self._options
        starts = {
            STARTS: self.draw_starts(options.starts, options.seed),
            FALLS: sample_by_class(self.world, options.n, options.seed).falls,
        }
        for kind, falls in starts.items():
            for way in self.ways:
                for k, fall in enumerate(falls):
                    yield Piece(body=self.name, way=way, kind=kind, number=k, fall=fall)

    def draw_starts(self, count: int, seed: int) -> list[Fall]:
        """Draw the makers' starts without repetition; each is settled with held joints.

        Angles beyond the robot's ranges are clipped to them.
        """
        robot, source = self.world.robot, self.source
        rows = np.array([position for position, _ in read_pickle(self.pickled)])
        if rows.shape[1] != source.nq:
            raise ValueError(f"{self.pickled}: expected {source.nq} positions as the model has")
        (root,) = np.flatnonzero(source.jnt_type == mujoco.mjtJoint.mjJNT_FREE)
        at = int(source.jnt_qposadr[root])
        columns = [int(source.joint(name).qposadr[0]) for name in robot.joint_names]
        falls = []
        for row in rows[np.random.default_rng(seed).permutation(len(rows))[:count]]:
            posture = Posture(
                position=row[at : at + 3],
                orientation=quaternion.normalize(row[at + 3 : at + 7]),
                joint_pos=np.clip(row[columns], robot.lower, robot.upper),
            )
            rest = find_rest(self.world, posture)
            side = classify(rest.orientation) or UNCLASSED
            falls.append(Fall(posture=rest, start_class=side))
        return falls


class PlainArrays(pickle.Unpickler):
    """Reads pickles of numpy arrays; one that names anything else ends the reading.

    A pickle is a program, which may call all that it can name.
    """

    def find_class(self, module: str, name: str) -> Any:
        """Return what a plain array is made with."""
        plain = {"ndarray", "dtype", "_reconstruct", "_frombuffer"}
        if module.partition(".")[0] != "numpy" or name not in plain:
            raise pickle.UnpicklingError(
                f"it names {module}.{name}, expected numpy arrays alone: not loaded"
            )
        return super().find_class(module, name)


def read_pickle(path: Path) -> list[tuple[Array, Array]]:
    """Read the start states of a pickle: positions (nq,) and controls (nu,) of each."""
    with path.open("rb") as file:
        return PlainArrays(file).load()


class HeadGauge:
    """Measures the height of a robot's head by the sites of the model that it was made from."""

    def __init__(self, source: mujoco.MjModel, model: mujoco.MjModel, standing: float) -> None:
        """Find the sites of a source model in the robot's own one.

        Args:
            source: The model with the sites.
            model: The robot's, whose bodies have the same names and frames.
            standing: Height of a standing robot's head [m].

        Raises:
            ValueError: if a site is missing, or elsewhere in the robot's model.
        """
        self._model, self._data, self._standing = model, mujoco.MjData(model), standing
        self._points = {name: _find_point(source, model, name) for name in (HEAD, *FEET)}
        before = mujoco.MjData(source)
        mujoco.mj_kinematics(source, before)
        mujoco.mj_kinematics(model, self._data)
        free = np.flatnonzero(source.jnt_type == mujoco.mjtJoint.mjJNT_FREE)[0]
        root = int(source.jnt_bodyid[free])
        for name in self._points:
            was = _see_from(before, root, before.site(name).xpos)
            now = _see_from(self._data, 1, self._locate(name))
            if (apart := float(np.linalg.norm(was - now))) > APART:
                raise ValueError(
                    f"site '{name}' is {1e3 * apart:.0f} mm from its place in the source model, "
                    f"expected at most {1e3 * APART:.0f} mm: import the robot again"
                )

    def measure(self, qpos: Array) -> float:
        """Return the height of the head as a share of the standing one, at positions (nq,)."""
        self._data.qpos[:] = qpos
        mujoco.mj_kinematics(self._model, self._data)
        feet = np.mean([self._locate(name)[2] for name in FEET])
        return float(self._locate(HEAD)[2] - feet) / self._standing

    def _locate(self, name: str) -> Array:
        body, position = self._points[name]
        return self._data.xpos[body] + self._data.xmat[body].reshape(3, 3) @ position


def is_up(share: float) -> bool:
    """Tell whether a head is as high as that of a standing robot, by its share of that height."""
    return abs(1.0 - share) < TOLERANCE


def _find_point(source: mujoco.MjModel, model: mujoco.MjModel, name: str) -> tuple[int, Array]:
    """Find the body and the place in its frame of a site, in a model without welded bodies."""
    site = source.site(name).id
    body, position = int(source.site_bodyid[site]), source.site_pos[site].copy()
    while (own := _find_body(model, source.body(body).name)) < 0:
        if not body:
            raise ValueError(f"site '{name}' is on no body of the robot, expected one")
        position = source.body_pos[body] + quaternion.rotate(source.body_quat[body], position)
        body = int(source.body_parentid[body])
    return own, position


def _find_body(model: mujoco.MjModel, name: str) -> int:
    return mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)


def _see_from(data: mujoco.MjData, body: int, point: Array) -> Array:
    return data.xmat[body].reshape(3, 3).T @ (point - data.xpos[body])


def main(options: BodyOptions) -> None:
    """Measure all bodies, and write the figures of each way from each kind of starts."""
    bodies = [load_body(options, name) for name in options.bodies]
    for body in bodies:
        assert body.gauge  # told before any rise if its sites are elsewhere
    pieces = [piece for body in bodies for piece in body.list_pieces()]
    ledger = open_ledger(options, bodies) if options.ledger else None
    found = do_pieces(partial(rise_on_body, options), pieces, options, ledger=ledger, kind=BodyRise)
    cases = dict[str, list[BodyRise]]()
    for piece, rise in zip(pieces, found, strict=True):
        cases.setdefault(f"{piece.body}: {piece.way}, {piece.kind}", []).append(rise)
    result: dict[str, Any] = {
        "name": "bodies",
        "seed": options.seed,
        "n": options.n,
        "n_starts": options.starts,
        "search_budget_s": options.search_budget,
        "without_motions": [body.name for body in bodies if not body.has_motions],
        "cases": {name: summarize_case(rises) for name, rises in cases.items()},
    }
    write_results(result, FIGURES, options.json)


load_body = lru_cache(maxsize=None)(BenchedBody)


def open_ledger(options: BodyOptions, bodies: Sequence[BenchedBody]) -> Ledger:
    """Open the ledger of finished rises, or begin one."""
    assert options.ledger is not None
    recipe = {
        "program": hash_program(),
        "seed": options.seed,
        "n": options.n,
        "search_budget": options.search_budget,
        "robots": {body.name: hash_folder(body.world.robot.folder) for body in bodies},
    }
    return Ledger.resume(options.ledger, recipe)


def rise_on_body(options: BodyOptions, piece: Piece) -> BodyRise:
    """Rise once."""
    body = load_body(options, piece.body)
    fall, strategy = piece.fall, body.strategies[piece.way]
    # Limp, a robot does not stay in a start of its makers.
    session = SessionOptions(start_class=fall.start_class, settle=piece.kind == FALLS)
    twin = Twin(body.world, fall.posture)
    rise = rise_once(twin, strategy, [options.seed, 1, piece.number], session)
    heads = measure_heads(rise, body.gauge)
    return BodyRise(**vars(rise.figures()), bench_class=fall.start_class, **heads)


def measure_heads(rise: Rise, gauge: HeadGauge) -> dict[str, Any]:
    """Measure the head of a robot at the time limit and at the end of its rise.

    A run that was aborted is none that ends standing; one that ended in a held stand stands on.
    """
    in_time, at_end, share = False, False, None
    outcome, run = rise.outcome, rise.run
    if outcome is not None and run is not None and len(outcome.qpos):
        share = gauge.measure(outcome.qpos[-1])
        is_done = run.ending is Ending.DONE and rise.attempts[-1].abort is None
        at_end = is_done and is_up(share)
        limit = round(TIME_LIMIT / outcome.record.period)
        in_time = rise.stood and at_end
        if len(outcome.qpos) >= limit:
            in_time = is_up(gauge.measure(outcome.qpos[limit - 1]))
    return {"head_in_time": in_time, "head_at_end": at_end, "head_share": share}


def summarize_case(rises: Sequence[BodyRise]) -> dict[str, Any]:
    """Summarize rises by both measures, over all and by class."""
    failures = [
        f"{number}, {rise.bench_class}: {rise.reason}"
        for number, rise in enumerate(rises, 1)
        if not rise.stood
    ]
    sides = dict.fromkeys(str(rise.bench_class) for rise in rises)
    classes = {
        side: summarize([rise for rise in rises if rise.bench_class == side]) for side in sides
    }
    return summarize(rises) | {"classes": classes, "failures": failures}


def summarize(rises: Sequence[BodyRise]) -> dict[str, Any]:
    """Summarize rises by both measures."""
    figures = asdict(RiseSummary.of(rises))
    for key in ("head_in_time", "head_at_end"):
        count = sum(getattr(rise, key) for rise in rises)
        figures |= {key: count, f"{key}_interval_95": wilson_interval(count, len(rises))}
    return figures


if __name__ == "__main__":
    main(tyro.cli(BodyOptions, description=__doc__))
