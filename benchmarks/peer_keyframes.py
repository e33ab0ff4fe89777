"""Compare rises with the robot maker's own get-up keyframes: same falls, limit, servo, judge.

The peer is pages 122 (from prone) and 123 (from supine) of the OP3's action file, which the
maker's soccer demo plays. They are not part of this package: `--peers` names a folder with
`op3-getup-pages.json`, the decoded pages.

How they are played. As in the soccer demo, a page begins in the maker's walking stance: the
joints go there straight from where they are, all together, the farthest at 1.5 rad/s (the
approach of `MotionPlayer`). Then the direction of gravity in the torso, as the IMU measures it,
selects the page: prone where the chest faces down, supine where it faces up, however far the robot
lies on its side. (A page chosen before the approach fails whenever the approach rolls the robot
over.) Every step takes its `move_s` and is held for its `pause_s`. In between, a monotone cubic
(PCHIP) stands for the maker's velocity ramps: it starts, ends and pauses at rest, reverses without
overshoot, and does not slow down at a step where a joint keeps moving in the same direction
without a pause. The last posture is held until the stand is judged.

Every strategy gets one attempt through the same guard and judge. The peer is played open loop: no
preflight refuses it and no monitor gives it up. Plans and policies run as users get them, so a
plan that finds no rise, or that its preflight refuses, counts as not stood.

    python benchmarks/peer_keyframes.py --peers FOLDER --n 20 --seed 11 --json peer.json
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table
from scipy.interpolate import PchipInterpolator
from script import counting

from drivers import Command, State
from humanoid_getup.benchmarks.rise import BENCH_CLASSES, MeasuredRise, list_pieces, measure_rise
from humanoid_getup.experiments.falls import sample_falls
from humanoid_getup.experiments.judging.standing import HOLD
from humanoid_getup.experiments.judging.summary import RiseSummary
from humanoid_getup.motions.motion import StartClass
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.planning.planner_settings import PlannerSettings
from humanoid_getup.playback.play import APPROACH_SPEED
from humanoid_getup.playback.supervisor import Supervisor
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.learned_rise import LearnedRise
from humanoid_getup.strategies.plan import Plan, RiseStatus, Strategy
from humanoid_getup.strategies.planned_rise import PlannedRise
from robots import Posture, Robot, TorqueLimit, load_robot
from robots.kinematics import GravitySense, imu_in_torso
from robots.quaternion import Array
from robots.servo import LimitMode
from robots.storage.encoding import to_json, to_plain
from robots.storage.files import write_atomically

PAGES_FILE = "op3-getup-pages.json"
PAGES: dict[StartClass, int] = {"prone": 122, "supine": 123}
MODES: dict[str, LimitMode] = {"PWM": "pwm", "current": "current"}
LIMITS = {
    f"{torque:.1f} N·m by {name}": TorqueLimit(torque, mode)
    for name, mode in MODES.items()
    for torque in (4.1, 3.0, 2.5, 2.0)
}
"""Torque limits by how the tables name them."""
PLANNED, ROBUST, GENTLE, PEER = "planned", "robust", "gentle", "maker's keyframes"


@dataclass(frozen=True, kw_only=True)
class Page:
    """A page of the maker's action file: key postures and their times."""

    time: Array
    """Times at which a posture is reached, or left after a pause, from the start [s], (K,)."""
    joint_pos: Array
    """Joint angles at these times [rad], (K, n)."""

    @classmethod
    def load(cls, folder: Path, number: int, robot: Robot) -> Page:
        """Read a page of the decoded action file."""
        pages = json.loads((folder / PAGES_FILE).read_text("utf-8"))["pages"]
        page = next(page for page in pages if page["page"] == number)
        time, postures, now = [], [], 0.0
        for step in page["steps"]:
            now += step["move_s"]
            posture = [step["pos_rad"][name] for name in robot.joint_names]
            leave = now + step["pause_s"]
            for key in (now, leave) if leave > now else (now,):
                time.append(key)
                postures.append(posture)
            now = leave
        return cls(time=np.array(time), joint_pos=np.array(postures))

    def begin_at(self, joint_pos: Array) -> PchipInterpolator:
        """Interpolate joint targets [rad] over time [s], from rest to rest.

        Args:
            joint_pos: Joint angles from which the page is begun [rad], (n,).
        """
        time = np.concatenate([[-1.0, 0.0], self.time, [self.time[-1] + 1.0]])
        keys = np.vstack([joint_pos, joint_pos, self.joint_pos, self.joint_pos[-1]])
        return PchipInterpolator(time, keys)


class KeyframePlayer:
    """Goes to the maker's walking stance, then plays the page for how the robot lies by then."""

    def __init__(
        self,
        world: World,
        stance: Array,
        pages: dict[StartClass, Page],
        torque_limit: float | None,
    ) -> None:
        self._robot, self._stance, self._pages = world.robot, stance, pages
        self._torque_limit = torque_limit
        self._sense_gravity = GravitySense(imu_in_torso(world.robot, world.model))
        self.longest = max(page.time[-1] for page in pages.values()) + HOLD
        """Time that the longest page and the hold take [s]."""

    @property
    def done(self) -> bool:
        """Return whether the page and the hold are over."""
        return self._clock - self._begin >= self._end - 1e-9

    def reset(self, state: State) -> None:
        """Begin at the measured joint angles."""
        self._begin = self._clock = state.time
        self._from, self._page = state.joint_pos, None
        self._approach = float(np.abs(self._stance - state.joint_pos).max()) / APPROACH_SPEED
        self._end = self._approach + self.longest

    def step(self, state: State) -> Command:
        """Send the targets that are due at the measurement."""
        self._clock = state.time
        time = state.time - self._begin - self._approach
        return Command.position(self._robot, self._target(time, state), self._torque_limit)

    def _target(self, time: float, state: State) -> Array:
        if time < 0.0:
            return self._stance + (time / self._approach) * (self._stance - self._from)
        if self._page is None:
            page = self._pages[select_page(self._sense_gravity(state.orientation))]
            self._page, self._last = page.begin_at(self._stance), float(page.time[-1])
            self._end = self._approach + self._last + HOLD
        return self._page(min(time, self._last))


def select_page(gravity_b: Array) -> StartClass:
    """Tell from gravity in the torso which page is played."""
    return "prone" if gravity_b[0] > 0.0 else "supine"


@dataclass(frozen=True, kw_only=True)
class KeyframePlan(Plan):
    """Keyframes to be played open loop, whatever a preflight or a monitor would say."""

    stance: Array
    """Joint angles in which the maker's robot begins a page [rad], (n,)."""
    pages: dict[StartClass, Page]

    @property
    def title(self) -> str:
        """Name what is played."""
        return PEER

    def controller(self, strategy: Strategy) -> Supervisor:
        """Make the player, without monitors."""
        limit = strategy.torque_limit.value
        return Supervisor(KeyframePlayer(strategy.world, self.stance, self.pages, limit), [])


class KeyframeRise:
    """Plays the maker's keyframes."""

    def __init__(self, folder: Path, world: World, torque_limit: TorqueLimit) -> None:
        self.world, self.torque_limit, robot = world, torque_limit, world.robot
        stance = json.loads((folder / PAGES_FILE).read_text("utf-8"))["walk_ready_rad"]
        self._plan = KeyframePlan(
            status=RiseStatus.STORED,
            stance=np.array([stance[name] for name in robot.joint_names]),
            pages={side: Page.load(folder, page, robot) for side, page in PAGES.items()},
        )

    def plan(self, _start: Posture, _rng: np.random.Generator) -> KeyframePlan:
        """Choose the keyframes; the page is chosen on the way."""
        return self._plan


def compare(
    world: World,
    peers: Path,
    *,
    seed: int,
    each: int,
    limits: dict[str, TorqueLimit] = LIMITS,
    ways: Sequence[str] = (),
    report: Callable[[MeasuredRise], object] = lambda _: None,
) -> dict[str, Any]:
    """Get up from the same falls under each torque limit by plans, `robust` and the keyframes.

    Args:
        world: Robot and scene.
        peers: Folder of the decoded pages.
        seed: Of the falls and the plans.
        each: Falls of each class: supine, prone, lateral.
        limits: Torque limits by name.
        ways: Names of the strategies; none for all.
        report: Called after each rise.
    """
    database = load_database(world.robot)
    rng = np.random.default_rng(seed)
    falls = sample_falls(world, dict.fromkeys(BENCH_CLASSES, each), rng)
    pieces, cases = list_pieces(falls, seed).values(), {}
    for name, limit in limits.items():
        strategies: dict[str, Strategy] = {
            PLANNED: PlannedRise(world, database, PlannerSettings(torque_limit=limit)),
            ROBUST: LearnedRise(world, ROBUST, torque_limit=limit),
            GENTLE: LearnedRise(world, GENTLE, torque_limit=limit),
            PEER: KeyframeRise(peers, world, limit),
        }
        cases[name] = {}
        for way in ways or strategies:
            rises = []
            for piece in pieces:
                rises.append(measure_rise(strategies[way], piece))
                report(rises[-1])
            cases[name][way] = to_plain(RiseSummary.of(rises)) | _count(rises)
    return {"name": "peer_keyframes", "seed": seed, "n": len(falls), "limits": cases}


def _count(rises: list[MeasuredRise]) -> dict[str, Any]:
    """Count a strategy's stands by class of fall and what was not played; keep why it failed."""
    each = len(rises) // len(BENCH_CLASSES)
    return {
        "stood_by_class": {
            name: sum(bool(rise.stood) for rise in rises[k * each : (k + 1) * each])
            for k, name in enumerate(BENCH_CLASSES)
        },
        "not_played": sum(rise.attempts == 0 for rise in rises),
        "failures": [rise.reason for rise in rises if not rise.stood],
    }


def print_table(result: dict[str, Any]) -> None:
    """Print stands, intervals, times and loads."""
    table = Table(box=None, header_style="bold")
    heads = ("stood", "95 %", "by class", "not played", "to stand [s]", "RMS [N·m]", "impact [m/s]")
    for head in ("torque limit", "strategy", *heads):
        table.add_column(head)
    for limit, ways in result["limits"].items():
        for way, case in ways.items():
            low, high = case["stood_interval_95"]
            table.add_row(
                limit,
                way,
                f"{case['stood']} of {case['n']}",
                f"{low:.0%} to {high:.0%}",
                ", ".join(str(count) for count in case["stood_by_class"].values()),
                str(case["not_played"]),
                *(_pair(case[key]) for key in ("stand_time_s", "rms_torque_nm", "head_impact_m_s")),
            )
    Console(width=160).print(table)


def _pair(summary: dict[str, float | None]) -> str:
    median, p95 = summary["median"], summary["p95"]
    return "–" if median is None or p95 is None else f"{median:.2f} ({p95:.2f})"


@dataclass(frozen=True, kw_only=True)
class Options:
    """Compare plans and `robust` with the maker's keyframes."""

    peers: Path
    """Folder with the decoded pages."""
    n: int = 20
    """Falls of each class: supine, prone, lateral."""
    seed: int = 11
    robot: str = "op3"
    scene: str = "flat"
    limits: tuple[str, ...] = ()
    """Torque limits by their names in the table; none for all."""
    ways: tuple[str, ...] = ()
    """Strategies by their names in the table; none for all."""
    json: Path | None = None
    """Where figures are written."""


def main(options: Options) -> None:
    """Measure, print, write."""
    world = World(load_robot(options.robot), options.scene)
    limits = {name: LIMITS[name] for name in options.limits or LIMITS}
    rises = len(limits) * (len(options.ways) or 4) * len(BENCH_CLASSES) * options.n
    with counting("rises", rises) as count:
        result = compare(
            world,
            options.peers,
            seed=options.seed,
            each=options.n,
            limits=limits,
            ways=options.ways,
            report=lambda _: count(1),
        )
    print_table(result)
    if options.json is not None:
        write_atomically(options.json, to_json(result))


if __name__ == "__main__":
    main(tyro.cli(Options))
