"""Measure how well a policy follows style curves, in what `getup eval` does not vary.

- durations: each named style in each of the paper's durations, by class of falls;
- edits: by how much the time of the rise moves when it is edited, and by how much it was asked to;
- held out: curves of rises that were kept from training, from where those rises begin.

The prior's folder is that of `getup prior`, which the policy was trained with. With `--picture`,
the curves of its planned rises are drawn: mean and deviation of each strategy.

    python benchmarks/followed_styles.py styled --prior out/prior --n 40 --json followed.json
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro
from numpy.typing import NDArray

from humanoid_getup.experiments.starts.falls import CLASSES, FallSet, sample_fall_set
from humanoid_getup.policy.onnx_policy import OnnxPolicy, find_policy
from humanoid_getup.reporting.style_plot import save_styles
from humanoid_getup.simulation.world import World
from humanoid_getup.style.curves import StyleCurves
from humanoid_getup.style.edits import EditError, find_rise, shift_rise
from humanoid_getup.style.style import Style
from humanoid_getup.style.style_file import list_styles, load_any_style, load_style
from robots import Posture, Robot, load_robot
from robots.body.lengths import leg_length
from robots.kinematics import read_posture
from robots.quaternion import Array
from robots.storage.encoding import to_json
from robots.storage.files import write_atomically
from sim2real.environment.styled.curve_library import LEAST_DURATION, LONGEST, is_held_out
from sim2real.perturbations import PolicyTrial
from sim2real.policy_evaluation import PolicyDriver
from sim2real.pose_prior.rise_set import RiseSet
from sim2real.training.styled_training import DURATIONS, LEGS, RISES

SHIFTS = (-0.5, -0.3, 0.3, 0.5)  # s
MANY = 5  # rises of a strategy that is drawn


@dataclass(frozen=True, kw_only=True)
class Options:
    """Measure how well a policy follows style curves."""

    policy: Annotated[str, tyro.conf.Positional]
    prior: Path | None = None
    """Folder of the pose prior, for the curves that were held out."""
    json: Path
    robot: str = "op3"
    n: int = 40
    """Falls, equally many of each class."""
    seed: int = 5
    picture: Path | None = None


@dataclass(frozen=True, eq=False)
class Followed:
    """How N robots followed curves."""

    stood: NDArray[np.bool_]
    """(N,)"""
    height_error: Array
    """Mean error of the neck height while the curves last, as a share of standing, (N,)."""
    angle_error: Array
    """Mean error of both angles [deg], (N,)."""
    restarts: NDArray[np.int_]
    """How often each robot restarted, (N,)."""
    step: float
    """Policy step [s]."""
    rise_time: Array
    """When the neck last passed the middle between its lowest height and its end [s], (N,)."""

    def summarize(self, chosen: NDArray[np.bool_] | None = None) -> dict[str, Any]:
        """Count the stands; take the medians of the errors of all rises, stood or not."""
        rows = np.ones(len(self.stood), dtype=bool) if chosen is None else chosen
        return {
            "n": int(rows.sum()),
            "stood": int(self.stood[rows].sum()),
            "height_error": float(np.median(self.height_error[rows])),
            "angle_error_deg": float(np.median(self.angle_error[rows])),
        }


@dataclass(frozen=True)
class Follower:
    """Lets a policy follow curves."""

    robot: Robot
    policy: OnnxPolicy

    def __call__(
        self, starts: Sequence[Posture], curves: Callable[[int, Array], StyleCurves]
    ) -> Followed:
        """Roll out from each start, with the curves that are chosen for it."""
        driver = PolicyDriver.of(self.policy, curves)
        rollouts = PolicyTrial(robot=self.robot, policy=driver).run(starts)
        height, errors = rollouts.features[:, :, 0], rollouts.style_error
        step = self.robot.control_period * self.policy.action.cycles
        time = step * np.arange(1, height.shape[1] + 1)
        return Followed(
            stood=rollouts.outcome.stood,
            height_error=errors[:, 0],
            angle_error=np.degrees(errors[:, 1:].mean(axis=1)),
            restarts=rollouts.restarts,
            step=step,
            rise_time=np.array([find_rise(time, row) for row in height]),
        )


def measure_durations(follow: Follower, falls: FallSet) -> dict[str, Any]:
    """Follow each style in the paper's durations."""
    starts = [fall.posture for fall in falls.falls]
    kinds = np.array([fall.start_class for fall in falls.falls])
    scale = math.sqrt(leg_length(follow.robot) / LEGS)
    found: dict[str, Any] = {}
    for name in list_styles():
        style = load_style(name, follow.robot)
        for person in DURATIONS:
            duration = scale * person
            rows = follow(starts, lambda _, seen, s=style, d=duration: s.choose(seen).lasting(d))
            cells = {kind: rows.summarize(kinds == kind) for kind in CLASSES}
            found[f"{name}, {duration:.2f} s"] = cells
            print(name, f"{duration:.2f} s", cells, flush=True)
    return found


def measure_edits(follow: Follower, falls: FallSet) -> list[dict[str, Any]]:
    """Move the time of the rise of the nearest named style, and compare it with the robot's."""
    starts = [fall.posture for fall in falls.falls]
    style = load_any_style(follow.robot)
    before = follow(starts, lambda _, seen: style.choose(seen))
    found = []
    for shift in SHIFTS:
        edited: dict[int, bool] = {}

        def choose(
            row: int, seen: Array, shift: float = shift, edited: dict = edited
        ) -> StyleCurves:
            curves = style.choose(seen)
            try:
                moved = shift_rise(curves, shift)
            except EditError:
                edited.setdefault(row, False)
                return curves
            edited.setdefault(row, True)
            return moved

        after = follow(starts, choose)
        both = before.stood & after.stood & np.array([edited[row] for row in range(len(starts))])
        both &= (before.restarts == 0) & (after.restarts == 0)
        moved = (after.rise_time - before.rise_time)[both]
        found.append(
            {
                "asked_s": shift,
                "n": int(both.sum()),
                "stood": int(after.stood.sum()),
                "moved_s_median": float(np.median(moved)) if both.any() else None,
                "within_10_percent": int((np.abs(moved - shift) <= 0.1 * abs(shift)).sum()),
                "within_a_policy_step": int((np.abs(moved - shift) <= after.step).sum()),
            }
        )
        print(found[-1], flush=True)
    return found


def measure_held_out(follow: Follower, rises: RiseSet) -> dict[str, Any]:
    """Follow the curves of rises that were kept from training, from where they begin."""
    kept = [(rise, curves) for rise, curves in list_curves(rises) if is_held_out(rise)]
    if not kept:
        return {"n": 0}
    model = rises.model
    starts = [read_posture(follow.robot, model, rises.qpos[rises.first[rise]]) for rise, _ in kept]
    return follow(starts, lambda row, _: kept[row][1]).summarize()


def list_curves(rises: RiseSet) -> Iterator[tuple[int, StyleCurves]]:
    """List the planned rises that end standing and last as long as those of trainings."""
    for rise, source in enumerate(rises.sources):
        if source.startswith("planned") and LEAST_DURATION <= rises.duration(rise) <= LONGEST:
            try:
                yield rise, rises.curves(rise)
            except ValueError:
                continue


def draw_strategies(rises: RiseSet, file: Path) -> None:
    """Draw the curves of planned rises by strategy, those of the right side mirrored."""
    found: dict[str, list[StyleCurves]] = {}
    for rise, curves in list_curves(rises):
        own = curves if curves.side[0] <= np.pi / 2 else curves.mirrored()
        found.setdefault(rises.sources[rise].removeprefix("planned: "), []).append(own)
    styles = [
        Style(name=name, curves=tuple(curves))
        for name, curves in sorted(found.items(), key=lambda entry: -len(entry[1]))
        if len(curves) >= MANY
    ]
    save_styles(styles[:MANY], file)


def main(options: Options) -> None:
    """Measure everything, write it down."""
    robot = load_robot(options.robot)
    policy = OnnxPolicy.load(find_policy(robot, options.policy), robot)
    if policy.style is None:
        raise SystemExit(f"policy '{options.policy}' follows no style curves")
    follow = Follower(robot, policy)
    each = options.n // len(CLASSES)
    falls = sample_fall_set(World(robot, "flat"), dict.fromkeys(CLASSES, each), options.seed)
    figures: dict[str, Any] = {"policy": options.policy, "n": options.n, "seed": options.seed}
    if options.prior is not None:
        rises = RiseSet.load(options.prior / RISES, robot)
        if options.picture is not None:
            draw_strategies(rises, options.picture)
        figures["held_out"] = measure_held_out(follow, rises)
        print("held out", figures["held_out"], flush=True)
    figures["edits"] = measure_edits(follow, falls)
    figures["durations"] = measure_durations(follow, falls)
    write_atomically(options.json, to_json(figures))


if __name__ == "__main__":
    main(tyro.cli(Options, config=(tyro.conf.OmitArgPrefixes,)))
