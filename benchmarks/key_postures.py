"""Rise through key postures: how closely they are passed, and why impossible ones are dropped.

Each rise begins with a settled fall of the next class (supine, prone, left, right) and has one key.
Reachable keys are drawn from frames of the stored motions that begin on the side on which the
robot lies and end standing, before their stand; every second four are perturbed by a normal error
of 0.1 rad in every joint, drawn again until they do not collide with themselves. Impossible ones
are postures of stored motions turned upside down, and the stand turned onto its head.

    python benchmarks/key_postures.py --n 20 --impossible 5 --seed 0 --json key_postures.json
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from rich.console import Console

from humanoid_getup.cli.shared.console import counting, format_figure, make_table
from humanoid_getup.experiments.judging.summary import wilson_interval
from humanoid_getup.experiments.starts.falls import CLASSES, sample_falls
from humanoid_getup.motions.key_posture import KeyPosture
from humanoid_getup.motions.motion_database import MotionDatabase, load_database
from humanoid_getup.planning.key_check import check_keys
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import RisePlan
from humanoid_getup.strategies.planned_rise import PlannedRise
from robots import Posture, Robot, load_robot, quaternion
from robots.storage.encoding import to_json, to_plain
from robots.storage.files import write_atomically

SPREAD = 0.1  # rad, standard deviation of a perturbed key's joints
MOST_DRAWS = 100
UPSIDE_DOWN = quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), np.pi)


def draw_reachable(
    database: MotionDatabase, robot: Robot, side: str, rng: np.random.Generator, *, perturb: bool
) -> KeyPosture:
    """Draw a frame of a motion that begins on a side, before its stand."""
    motions = [motion for motion in database.rising if motion.start_class == side]
    for _ in range(MOST_DRAWS):
        motion = motions[rng.integers(len(motions))]
        stands = motion.stand_time or motion.duration
        time = float(rng.uniform(0.0, stands))
        frame = int(np.searchsorted(motion.time, time))
        posture, name = motion.posture(frame), f"{motion.name}@{motion.time[frame]:.2f}"
        if perturb:
            angles = posture.joint_pos + rng.normal(scale=SPREAD, size=robot.n)
            posture = replace(posture, joint_pos=np.clip(angles, robot.lower, robot.upper))
            name += ", perturbed"
        key = KeyPosture(name=name, posture=posture)
        try:
            check_keys(robot, [key])
        except ValueError:
            continue
        return key
    raise RuntimeError(f"no key posture without self-collision in {MOST_DRAWS} draws")


def draw_impossible(
    database: MotionDatabase, robot: Robot, number: int, rng: np.random.Generator
) -> KeyPosture:
    """Turn the stand upside down, or a posture at which a motion stands."""
    if number == 0:
        return KeyPosture(name="the stand on its head", posture=_turn(robot.standing))
    motion = database.rising[rng.integers(len(database.rising))]
    frame = int(motion.entry_frames[-1])
    name = f"{motion.name}@{motion.time[frame]:.2f} upside down"
    return KeyPosture(name=name, posture=_turn(motion.posture(frame)))


def _turn(posture: Posture) -> Posture:
    turned = quaternion.multiply(posture.orientation, UPSIDE_DOWN)
    return replace(posture, orientation=turned)


def describe(key: KeyPosture, side: str, plan: RisePlan) -> dict[str, Any]:
    """Return what became of a key and of its rise."""
    (record,) = plan.keys
    return {
        "start_class": side,
        "planned": plan.planned,
        "stood": plan.status.name == "STOOD",
        "robust": plan.robust,
        "stand_time_s": plan.stand_time,
        "plan_and_filter_s": plan.plan_s + plan.filter_s,
        **to_plain(record.figures),
        "name": key.name,
    }


def summarize(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Count stands and kept keys, with intervals, and summarize errors and times."""
    n, kept = len(rows), [row for row in rows if row["kept"]]
    stood = sum(row["stood"] for row in rows)
    figures: dict[str, Any] = {
        "n": n,
        "planned": sum(row["planned"] for row in rows),
        "stood": stood,
        "stood_95": wilson_interval(stood, n),
        "kept": len(kept),
        "kept_95": wilson_interval(len(kept), n),
        "plan_and_filter_s": _spread([row["plan_and_filter_s"] for row in rows]),
    }
    if kept:
        for name in ("largest_joint_error_rad", "tilt_error_rad"):
            figures[name] = _spread([row[name] for row in kept])
        robust = Counter("16 of 16" if row["robust"] == 1.0 else "fewer" for row in kept)
        figures["disturbed checks stood"] = dict(robust)
    return figures


def _spread(values: list[float]) -> dict[str, float]:
    return {"median": float(np.median(values)), "p95": float(np.percentile(values, 95))}


def main(n: int = 20, impossible: int = 5, seed: int = 0, json: Path | None = None) -> None:
    """Rise through n reachable keys and some impossible ones."""
    if n < 1:
        raise SystemExit(f"--n is {n}, expected 1 or more")
    world = World(load_robot("op3"))
    database, rng = load_database(world.robot), np.random.default_rng(seed)
    count = n + impossible
    falls = sample_falls(world, dict.fromkeys(CLASSES, -(-count // len(CLASSES))), rng)
    by_class = {side: [f for f in falls if f.start_class == side] for side in CLASSES}
    cases: dict[str, list[dict[str, Any]]] = {"reachable": [], "impossible": []}
    with counting("rises", count) as advance:
        for number in range(count):
            side = CLASSES[number % len(CLASSES)]
            kind = "reachable" if number < n else "impossible"
            if kind == "reachable":
                perturb = number % 8 >= 4
                key = draw_reachable(database, world.robot, side, rng, perturb=perturb)
            else:
                key = draw_impossible(database, world.robot, number - n, rng)
            start = by_class[side][number // len(CLASSES)].posture
            own = np.random.default_rng([seed, number])  # a search must not change the next key
            plan = PlannedRise(world, database, keys=[key]).plan(start, own)
            cases[kind].append(describe(key, side, plan))
            advance(1)
    figures = {kind: summarize(rows) for kind, rows in cases.items() if rows}
    print_tables(figures, cases)
    if json is not None:
        record = {"name": "key_postures", "seed": seed, "n": n, "cases": figures, "rises": cases}
        write_atomically(json, to_json(record))


def print_tables(figures: dict[str, Any], cases: dict[str, list[dict[str, Any]]]) -> None:
    """Print the figures, and one line for each rise."""
    table = make_table(("figure", *figures), left=("figure",))
    for name in figures["reachable"]:
        cells = (row.get(name) for row in figures.values())
        table.add_row(name, *("" if cell is None else format_figure(cell) for cell in cells))
    Console().print(table)
    headings = ("start", "key", "stood", "at [s]", "joint [rad]", "tilt [rad]", "why not")
    rises = make_table(headings, left=("start", "key", "why not"))
    for row in (row for rows in cases.values() for row in rows):
        keys = ("time_s", "largest_joint_error_rad", "tilt_error_rad")
        numbers = ("" if row[k] is None else f"{row[k]:.3f}" for k in keys)
        stood = "yes" if row["stood"] else "no"
        rises.add_row(row["start_class"], row["name"], stood, *numbers, row["reason"])
    Console(width=160).print(rises)


if __name__ == "__main__":
    tyro.cli(main)
