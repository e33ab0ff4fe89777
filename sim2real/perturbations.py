"""Trials: under what a policy is evaluated, and what came of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.evaluation.statistics import summarize, wilson_interval
from humanoid_getup.policy.action import ActionSpec
from humanoid_getup.simulation.falls import Fall
from humanoid_getup.simulation.scene import load_scene
from robots import Posture, Robot
from robots.kinematics import place
from robots.quaternion import Array
from sim2real.environment.conditions import Conditions
from sim2real.environment.model_variants import PHYSICS, Change, free_play
from sim2real.environment.randomization import NOISE
from sim2real.environment.training_world import LONGEST_DELAY, build_world
from sim2real.environment.vectorized_simulation import Herd
from sim2real.policy_evaluation import DURATION, Policy, Rises, rise_all

PHYSICS_STEP = 0.002  # s, the twin's
PUSH_EVERY = 1.0  # s
UNITS = {
    "torque_limit": "N·m",
    "delay": "s",
    "voltage": "V",
    "backlash": "rad",
    "push": "m/s",
    "imu_tilt": "rad",
    "gyro_bias": "rad/s",
}
CHUNK = 250  # robots that are simulated at once


@dataclass(frozen=True, kw_only=True)
class Perturbation:
    """What differs from the robot's description; nothing by default."""

    torque_limit: float | None = None
    """Cap on every servo [N·m]."""
    pwm_limited: bool = False
    """The cap is a PWM limit, as servos in position mode have it."""
    delay: float = 0.0
    """Age of targets when the servos get them [s]."""
    voltage: float | None = None
    """Supply [V]."""
    friction: float | None = None
    """Sliding friction of every contact."""
    mass: float = 1.0
    """Share of every link's mass."""
    backlash: float = 0.0
    """Free play between every gear and its link, from end to end [rad]."""
    weak_servo: float = 1.0
    """Share of its torque and gain that one servo has, another in every robot."""
    push: float = 0.0
    """Speed of a push in a random direction, once a second [m/s]."""
    imu_tilt: float = 0.0
    """How far the IMU is turned about a random axis [rad]."""
    gyro_bias: float = 0.0
    """What the gyro tells too much, about a random axis [rad/s]."""
    noise: bool = False
    """Whether the sensors are as noisy as in training."""
    physics: str | None = None
    """One of ``PHYSICS``."""

    @property
    def label(self) -> str:
        """Return what differs, in words."""
        told = [
            f"{field.name.replace('_', ' ')} {_tell(getattr(self, field.name))} "
            f"{UNITS.get(field.name, '')}".rstrip()
            for field in fields(self)
            if getattr(self, field.name) != field.default
        ]
        return ", ".join(told) or "as described"


def run_trial(
    robot: Robot,
    action: ActionSpec,
    policy: Policy,
    starts: Sequence[Posture],
    trial: Perturbation,
    seed: int,
    *,
    scene: str = "flat",
    duration: float = DURATION,
    threads: int = 0,
    report: Callable[[int], None] = lambda _: None,
) -> list[Rises]:
    """Let a policy get robots up under a trial's conditions; return a record a chunk.

    Args:
        robot: Robot.
        action: What actions mean.
        policy: Acts.
        starts: Where the robots lie.
        trial: What differs from the robot's description.
        seed: Of what is left to chance: weak servos, pushes, the IMU's axis.
        scene: Scene by name.
        duration: How long [s].
        threads: Threads that step physics; 0 for all.
        report: Called with the number of robots that are done since.
    """
    changes: list[Change] = [PHYSICS[trial.physics]] if trial.physics else []
    if trial.backlash:
        changes.append(free_play(trial.backlash))
    delays = LONGEST_DELAY if trial.delay else 0.0
    place_in = load_scene(scene)
    model = build_world(robot, place_in, PHYSICS_STEP, delays, changes)
    rng = np.random.default_rng(seed)
    records = []
    for first in range(0, len(starts), CHUNK):
        some = starts[first : first + CHUNK]
        herd = Herd(
            model,
            robot,
            len(some),
            cycles=action.cycles,
            pwm_limit=action.pwm_limit,
            threads=threads,
            noise=NOISE,
        )
        herd.set_conditions(np.arange(herd.n), make_conditions(herd, trial, place_in.friction, rng))
        qpos = np.array([place(robot, model, posture) for posture in some])
        push = _Pushes(herd, trial.push, round(PUSH_EVERY / herd.step_time), rng)
        records.append(
            rise_all(
                herd,
                action,
                policy,
                qpos,
                duration=duration,
                rng=rng if trial.noise else None,
                on_step=push,
            )
        )
        report(len(some))
    return records


def summarize_trial(
    starts: Sequence[Fall], records: Sequence[Rises], classes: Sequence[str]
) -> dict[str, Any]:
    """Summarize by class and over all: counts, intervals, times [s], load, impact."""
    kinds = np.array([fall.start_class for fall in starts])
    columns = {
        "stood": np.concatenate([r.stood for r in records]),
        "stand_time_s": np.concatenate([r.stand_time for r in records]),
        "rms_torque_nm": np.concatenate([r.rms_torque() for r in records]),
        "peak_torque_nm": np.concatenate([r.peak_torque() for r in records]),
        "head_impact_m_s": np.concatenate([r.head_impact for r in records]),
        "standing_joint_speed_rad_s": np.concatenate([r.standing_speed() for r in records]),
    }
    everyone = np.ones(len(kinds), dtype=bool)
    return {
        "classes": {name: _summarize_rows(columns, kinds == name) for name in classes},
        "all": _summarize_rows(columns, everyone),
    }


def _summarize_rows(columns: dict[str, Array], rows: NDArray[np.bool_]) -> dict[str, Any]:
    stood = columns["stood"][rows]
    figures: dict[str, Any] = {"n": int(rows.sum()), "stood": int(stood.sum())}
    figures["stood_interval_95"] = list(wilson_interval(int(stood.sum()), int(rows.sum())))
    for name, values in columns.items():
        if name != "stood":
            figures[name] = summarize(values[rows])
    return figures


def make_conditions(
    herd: Herd, trial: Perturbation, friction: float, rng: np.random.Generator
) -> Conditions:
    """Make the conditions of a herd's robots under a trial.

    Args:
        herd: Robots.
        trial: What differs from their description.
        friction: The scene's sliding friction, where the trial says nothing.
        rng: Source of what is left to chance: the weak servo, the IMU's axis.
    """
    robot, n = herd.robot, herd.n
    c = Conditions.nominal(
        robot,
        herd.model.nbody,
        n,
        friction=friction if trial.friction is None else trial.friction,
        torque_limit=trial.torque_limit,
    )
    c.mass[:] = trial.mass
    c.pwm_limited[:] = trial.pwm_limited
    c.action_delay[:] = trial.delay
    if trial.voltage is not None:
        c.voltage[:] = trial.voltage
    c.strength[np.arange(n), rng.integers(0, robot.n, n)] = trial.weak_servo
    for errors, size in ((c.imu_tilt, trial.imu_tilt), (c.gyro_bias, trial.gyro_bias)):
        axis = rng.normal(size=(n, 3))
        errors[:] = size * axis / np.linalg.norm(axis, axis=1, keepdims=True)
    return c


def _tell(value: object) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)


class _Pushes:
    """Pushes every robot once in a while, in a horizontal direction of chance."""

    def __init__(self, herd: Herd, speed: float, every: int, rng: np.random.Generator) -> None:
        self._herd, self._speed, self._every, self._rng = herd, speed, every, rng

    def __call__(self, step: int) -> None:
        if not self._speed or step % self._every != self._every // 2:
            return
        n = self._herd.n
        angle = self._rng.uniform(0.0, 2.0 * np.pi, n)
        push = self._speed * np.stack([np.cos(angle), np.sin(angle), np.zeros(n)], axis=1)
        self._herd.push(np.arange(n), push)
