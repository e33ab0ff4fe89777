"""Puts a policy through every trial of docs/reference/benchmarks, and prints the tables.

    python benchmarks/policy_tables.py robust --falls falls.npz --n 1000 --json tables.json

The falls are those of `getup eval --falls`. What was measured already is kept in the JSON file
and not measured again.
"""

from __future__ import annotations

import hashlib
import json
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import mujoco
import numpy as np
import tyro
from msgspec import structs
from rich.console import Console

from humanoid_getup.experiments.disturbances import RandomAxis
from humanoid_getup.experiments.falls import CLASSES, Fall, FallSet
from humanoid_getup.experiments.judging.summary import wilson_interval
from humanoid_getup.policy.onnx_policy import OnnxPolicy, find_policy
from humanoid_getup.scenes.named_scenes import load_scene
from humanoid_getup.scenes.scene import FLAT_SCENE
from robots import Posture, Robot, load_robot
from robots.kinematics import read_posture
from robots.quaternion import Array
from robots.storage.encoding import to_json, to_plain
from robots.storage.files import write_atomically
from sim2real.environment.training_world import MODEL_VARIANTS, build_training_world
from sim2real.evaluation import Perturbation, PolicyTrial
from sim2real.policy_evaluation import PolicyRollouts, summarize_rollouts

GROUPS: dict[str, dict[str, Perturbation]] = {
    "torque": {
        "4.1 N·m": Perturbation(),
        "3.0 N·m": Perturbation(torque_limit=3.0),
        "2.5 N·m": Perturbation(torque_limit=2.5),
        "2.0 N·m": Perturbation(torque_limit=2.0),
        "3.0 N·m by PWM": Perturbation(torque_limit=3.0, limit_by="pwm"),
        "2.5 N·m by PWM": Perturbation(torque_limit=2.5, limit_by="pwm"),
        "2.0 N·m by PWM": Perturbation(torque_limit=2.0, limit_by="pwm"),
    },
    "robustness": {
        "delay 20 ms": Perturbation(action_delay=0.02),
        "delay 40 ms": Perturbation(action_delay=0.04),
        "delay 60 ms": Perturbation(action_delay=0.06),
        "supply 10.5 V": Perturbation(voltage=10.5),
        "supply 11.1 V": Perturbation(voltage=11.1),
        "supply 12.6 V": Perturbation(voltage=12.6),
        "friction 0.3": Perturbation(friction=0.3),
        "friction 0.5": Perturbation(friction=0.5),
        "friction 1.2": Perturbation(friction=1.2),
        "mass -15 %": Perturbation(mass=0.85),
        "mass +15 %": Perturbation(mass=1.15),
        "backlash 0.25 deg": Perturbation(hinge_backlash=math.radians(0.25)),
        "backlash 1 deg": Perturbation(hinge_backlash=math.radians(1.0)),
        "backlash 2 deg": Perturbation(hinge_backlash=math.radians(2.0)),
        "one servo at 60 %": Perturbation(weak_servo=0.6),
        "pushes 0.3 m/s": Perturbation(push=0.3),
        "pushes 0.5 m/s": Perturbation(push=0.5),
        "sensor noise": Perturbation(noise=True),
        "gyro bias 2 deg/s": Perturbation(gyro_bias=RandomAxis(math.radians(2.0))),
        "IMU rotated 2 deg": Perturbation(imu_tilt=RandomAxis(math.radians(2.0))),
        "IMU rotated 5 deg": Perturbation(imu_tilt=RandomAxis(math.radians(5.0))),
    },
    "transfer": {name: Perturbation(physics=name) for name in MODEL_VARIANTS},
}
STANDING: dict[str, Perturbation] = {
    "undisturbed": Perturbation(),
    "pushes 0.3 m/s": Perturbation(push=0.3),
    "pushes 0.5 m/s": Perturbation(push=0.5),
    "pushes 0.7 m/s": Perturbation(push=0.7),
}


@dataclass(frozen=True, kw_only=True)
class Options:
    """Put a policy through every trial."""

    policy: Annotated[str, tyro.conf.Positional]
    falls: Path
    """Settled falls."""
    json: Path
    """Where figures are kept."""
    robot: str = "op3"
    n: int = 1000
    """Falls of each trial of the group torque."""
    fewer: int = 200
    """Falls of each trial of the other groups."""
    seed: int = 1
    after: int = 200
    """Falls from which robots get up before it is seen how they stand."""
    groups: tuple[str, ...] = (*GROUPS, "standing")
    threads: int = 0


def main(options: Options) -> None:
    """Run what is not measured yet, write it down, print it."""
    robot = load_robot(options.robot)
    file = find_policy(robot, options.policy)
    policy = OnnxPolicy.load(file, robot, robot.control_period)
    falls = FallSet.load(options.falls, robot)
    about = {
        "policy_sha256": hashlib.sha256(file.read_bytes()).hexdigest(),
        "falls_seed": falls.seed,
        "seed": options.seed,
    }
    kept = json.loads(options.json.read_text()) if options.json.exists() else about
    if {key: kept[key] for key in about} != about:
        raise SystemExit(f"{options.json} holds the figures of another policy, falls or seed")
    console = Console(width=160)

    def put_through(trial: Perturbation, starts: Sequence[Posture]) -> PolicyRollouts:
        style = policy.style
        choose = (lambda _, features: style.choose(features)) if style else None
        return PolicyTrial(
            policy=policy,
            choose_style=choose,
            perturbation=trial,
            seed=options.seed,
            threads=options.threads,
        ).run(starts)

    def measure(key: str, compute: Callable[[], object]) -> None:
        begun = time.monotonic()
        if key not in kept:
            kept[key] = to_plain(compute())
            write_atomically(options.json, to_json(kept))
        console.print(f"{_row(key, kept[key])}  [{time.monotonic() - begun:.0f} s]")

    for group in options.groups:
        if group == "standing":
            stands = _find_stands(robot, put_through, falls.choose(options.after // len(CLASSES)))
            for name, trial in STANDING.items():
                measure(
                    f"{group}: {name}",
                    lambda t=trial, s=stands: _hold(robot, s, put_through(t, s)),
                )
            continue
        some = falls.choose((options.n if group == "torque" else options.fewer) // len(CLASSES))
        starts = [fall.posture for fall in some.falls]
        for name, trial in GROUPS[group].items():
            measure(
                f"{group}: {name}, n {len(starts)}",
                lambda t=trial, f=some.falls, s=starts: summarize_rollouts(
                    f, put_through(t, s), CLASSES
                ),
            )


def _find_stands(
    robot: Robot,
    put_through: Callable[[Perturbation, Sequence[Posture]], PolicyRollouts],
    falls: FallSet,
) -> list[Posture]:
    """Let robots rise; return where those are that stand."""
    model = build_training_world(robot, load_scene(falls.scene, robot), 0.002).model
    risen = put_through(Perturbation(), [fall.posture for fall in falls.falls])
    return [read_posture(robot, model, q[-1]) for q in risen.qpos[risen.outcome.stood]]


def _hold(robot: Robot, stands: Sequence[Posture], rises: PolicyRollouts) -> dict[str, Any]:
    """Summarize who stays up for all of the time: a robot that fell and rose again did not."""
    held = [Fall(posture=posture, start_class="held") for posture in stands]
    figures = summarize_rollouts(held, rises, ("held",))
    stayed = np.asarray(rises.outcome.upright.all(axis=1))
    stood = int(stayed.sum())
    interval = wilson_interval(stood, len(stayed))
    held_up = structs.replace(figures.all, stood=stood, stood_interval_95=interval)
    depths = _find_own_contacts(robot, rises.qpos[stayed, -1])
    return {"classes": {"held": held_up}, "all": held_up, "own_contact_depths_m": depths}


def _find_own_contacts(robot: Robot, ends: Array) -> list[float]:
    """Return how deep limbs lie in each other, a number for each posture in which any touch."""
    model = build_training_world(robot, FLAT_SCENE, 0.002).model
    data, depths = mujoco.MjData(model), []
    for qpos in ends:
        data.qpos[:] = qpos
        mujoco.mj_forward(model, data)
        own = (model.geom_bodyid[data.contact.geom] != 0).all(axis=1)
        if own.any():
            depths.append(float(np.maximum(-data.contact.dist[own], 0.0).max()))
    return depths


def _row(name: str, figures: dict[str, Any]) -> str:
    whole = figures["all"]
    shares = [f"{100 * row['stood'] / max(row['n'], 1):.1f}" for row in figures["classes"].values()]
    low, high = whole["stood_interval_95"]
    cells = (
        name,
        f"{whole['stood']}/{whole['n']}",
        f"{100 * low:.1f}% to {100 * high:.1f}%",
        *shares,
        _two(whole["stand_time_s"]),
        _two(whole["rms_torque_nm"]),
        _two(whole["head_impact_m_s"]),
        _two(whole["standing_joint_speed_rad_s"]),
    )
    row = "| " + " | ".join(cells) + " |"
    depths = figures.get("own_contact_depths_m")
    if depths:
        row += f" limbs touch in {len(depths)}, {1e3 * max(depths):.2f} mm deep at most"
    return row


def _two(summary: dict[str, float | None]) -> str:
    median, p95 = summary["median"], summary["p95"]
    return "–" if median is None or p95 is None else f"{median:.2f} ({p95:.2f})"


if __name__ == "__main__":
    main(tyro.cli(Options, config=(tyro.conf.OmitArgPrefixes,)))
