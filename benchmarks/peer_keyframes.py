"""Compare rises with the robot maker's own get-up keyframes: same falls, limit, servo, judge.

The peer is pages 122 (from prone) and 123 (from supine) of the OP3's action file, which the
maker's soccer demo plays. They are not part of this package: `--peers` names a folder with
`op3-getup-pages.json`, the decoded pages.

How a page is played. The direction of gravity in the torso selects it: prone where the chest
faces down, supine where it faces up, however far the robot lies on its side. The joints go
straight from where they are to the page's first posture at 1.5 rad/s, as `MotionPlayer` does
with every motion; this replaces the first step's own time. The other steps take their `move_s` and
are held for their `pause_s`. In between, a monotone cubic (PCHIP) stands for the maker's
velocity ramps: it starts, ends and pauses at rest, reverses without overshoot, and does not slow
down at a step where a joint keeps moving in the same direction without a pause. The last posture
is held until the stand is judged.

Every strategy gets one attempt through the same guard, supervision of the servos and judge. The
peer is played open loop: no preflight refuses it and no monitor expects a tilt of it. Plans and
policies run as users get them, so a rise that their preflight refuses counts as not stood.

    python benchmarks/peer_keyframes.py --peers FOLDER --n 20 --seed 11 --json peer.json
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table
from scipy.interpolate import PchipInterpolator

from drivers import State
from humanoid_getup.benchmarks.rise import BENCH_CLASSES, bench_methods
from humanoid_getup.cli.output import counting, to_json
from humanoid_getup.motions.motion import Motion, StartClass
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.playback.preflight import Verdict
from humanoid_getup.simulation.scene import load_scene
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.learned_rise import LearnedRise
from humanoid_getup.strategies.plan import MotionPlan, RiseOptions, RiseStatus, Strategy
from humanoid_getup.strategies.planned_rise import PlannedRise
from robots import FULL_TORQUE, Posture, Robot, TorqueLimit, load_robot, quaternion
from robots.files import write_atomically
from robots.quaternion import Array

PAGES_FILE = "op3-getup-pages.json"
PAGES: dict[StartClass, int] = {"prone": 122, "supine": 123}
LIMITS = {
    "none (4.1 N·m)": FULL_TORQUE,  # a PWM limit of the whole supply is no limit
    "3.0 N·m by PWM": TorqueLimit(3.0, "pwm"),
    "2.5 N·m by PWM": TorqueLimit(2.5, "pwm"),
    "2.0 N·m by PWM": TorqueLimit(2.0, "pwm"),
    "2.5 N·m ideal": TorqueLimit(2.5),
    "2.0 N·m ideal": TorqueLimit(2.0),
}
"""Torque limits by how the tables name them."""
PLANNED, ROBUST, PEER = "planned", "robust", "maker's keyframes"


@dataclass(frozen=True, kw_only=True)
class Page:
    """A page of the maker's action file: key postures and their times."""

    name: str
    time: Array
    """Times at which a posture is reached, or left after a pause [s], (K,)."""
    joint_pos: Array
    """Joint angles at these times [rad], (K, n)."""

    @classmethod
    def load(cls, folder: Path, number: int, robot: Robot) -> Page:
        """Read a page of the decoded action file, from its first posture on."""
        decoded = json.loads((folder / PAGES_FILE).read_text("utf-8"))
        page = next(page for page in decoded["pages"] if page["page"] == number)
        time, postures, now = [], [], 0.0
        for index, step in enumerate(page["steps"]):
            now += step["move_s"] if index else 0.0
            posture = [step["pos_rad"][name] for name in robot.joint_names]
            leave = now + step["pause_s"]
            for key in (now, leave) if leave > now else (now,):
                time.append(key)
                postures.append(posture)
            now = leave
        return cls(name=f"page {number}", time=np.array(time), joint_pos=np.array(postures))

    def sample(self, time: Array) -> Array:
        """Interpolate the joint targets [rad] at times within the page [s], (T, n)."""
        resting = np.concatenate([[self.time[0] - 1.0], self.time, [self.time[-1] + 1.0]])
        keys = np.concatenate([self.joint_pos[:1], self.joint_pos, self.joint_pos[-1:]])
        return PchipInterpolator(resting, keys)(time)


@dataclass(frozen=True, kw_only=True)
class KeyframePlan(MotionPlan):
    """A page to be played open loop, whatever a preflight would say."""

    def preflight(
        self,
        _world: World,
        _torque_limit: TorqueLimit,
        _settled: State,
        _measure: Callable[[], State],
    ) -> Verdict:
        """Refuse nothing."""
        return Verdict()


class KeyframeRise:
    """Plays the page for the side on which the chest lies."""

    def __init__(self, folder: Path, robot: Robot) -> None:
        self._robot = robot
        self._pages = {side: Page.load(folder, page, robot) for side, page in PAGES.items()}

    def select(self, start: Posture) -> StartClass:
        """Tell from gravity in the torso which page is played."""
        forward = quaternion.gravity_in_body(start.orientation)[0]
        return "prone" if forward > 0.0 else "supine"

    def plan(self, start: Posture, _rng: np.random.Generator) -> KeyframePlan:
        """Choose the page."""
        side = self.select(start)
        motion = self._make_motion(self._pages[side], side, start)
        status = RiseStatus.STORED
        return KeyframePlan(status=status, reason=status.value, motion=motion, simulated=False)

    def _make_motion(self, page: Page, side: StartClass, start: Posture) -> Motion:
        """Sample a page; nothing is known of the root, so it stays where the robot lies."""
        period = self._robot.control_period
        time = np.append(np.arange(0.0, page.time[-1], period), page.time[-1])
        targets = page.sample(time)
        return Motion(
            name=page.name,
            robot=self._robot.name,
            start_class=side,
            strategy="keyframes",
            time=time,
            position=np.tile(start.position, (len(time), 1)),
            orientation=np.tile(start.orientation, (len(time), 1)),
            joint_pos=targets,
            joint_target=targets,
        )


def compare(
    world: World,
    peers: Path,
    *,
    seed: int,
    each: int,
    limits: dict[str, TorqueLimit] = LIMITS,
    report: Callable[[dict[str, Any]], None] = lambda _: None,
) -> dict[str, Any]:
    """Get up from the same falls under each torque limit by plans, `robust` and the keyframes.

    Args:
        world: Robot and scene.
        peers: Folder of the decoded pages.
        seed: Of the falls and the plans.
        each: Falls of each class: supine, prone, lateral.
        limits: Torque limits by name.
        report: Called with the record of each rise.
    """
    robot = world.robot
    database, peer = load_database(robot), KeyframeRise(peers, robot)
    cases = {}
    for name, limit in limits.items():
        records: list[dict[str, Any]] = []

        def keep(record: dict[str, Any], records: list[dict[str, Any]] = records) -> None:
            records.append(record)
            report(record)

        strategies: dict[str, Strategy] = {
            PLANNED: PlannedRise(world, database, RiseOptions(torque_limit=limit)),
            ROBUST: LearnedRise(world, ROBUST, torque_limit=limit),
            PEER: peer,
        }
        result = bench_methods(
            world,
            strategies,
            seed=seed,
            each=each,
            torque_limit=limit,
            heat=False,
            report=keep,
        )
        cases[name] = {
            way: summary | _count(records, way) for way, summary in result["cases"].items()
        }
    return {"name": "peer_keyframes", "seed": seed, "n": len(BENCH_CLASSES) * each, "limits": cases}


def _count(records: list[dict[str, Any]], way: str) -> dict[str, Any]:
    """Count a strategy's stands by class of fall and what was not played; keep why it failed."""
    ours = [record for record in records if record["way"] == way]
    each = len(ours) // len(BENCH_CLASSES)
    return {
        "stood_by_class": {
            name: sum(record["stood"] for record in ours[k * each : (k + 1) * each])
            for k, name in enumerate(BENCH_CLASSES)
        },
        "not_played": sum(record["attempts"] == 0 for record in ours),
        "failures": [record["reason"] for record in ours if not record["stood"]],
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
    json: Path | None = None
    """Where figures are written."""


def main(options: Options) -> None:
    """Measure, print, write."""
    world = World(load_robot(options.robot), load_scene(options.scene))
    with counting("rises", len(LIMITS) * 3 * len(BENCH_CLASSES) * options.n) as count:
        result = compare(
            world,
            options.peers,
            seed=options.seed,
            each=options.n,
            report=lambda _: count(1),
        )
    print_table(result)
    if options.json is not None:
        write_atomically(options.json, to_json(result))


if __name__ == "__main__":
    main(tyro.cli(Options))
