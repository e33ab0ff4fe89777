"""The preflight: judges a motion from the present start and supply, with torque off."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from drivers.safety_limits import find_max_temperature
from drivers.twin.device_models import AMBIENT_TEMPERATURE
from humanoid_getup.experiments.falls import classify
from humanoid_getup.experiments.judging.torque import LONG_SATURATION
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.posture_metric import measure_tilt
from humanoid_getup.playback.preflight_rollout import Figures, measure
from humanoid_getup.playback.simulated_play import describe_end
from humanoid_getup.simulation.world import World
from robots import FULL_TORQUE, Posture, Robot, TorqueLimit
from robots.quaternion import Array

ANGLE_SLACK = np.radians(1.0)  # by which a measured angle may exceed its joint's limit
SPEED_SLACK = 1.001
FAR_ANGLE = 0.1  # rad from the first frame, which the player must approach
FAR_TILT = math.radians(45.0)  # another side is 90 deg away
# On the twin, the motions of the OP3's database and 24 planned rises are at the torque-speed
# line for 0.7 s at a time and 1.2 s in total, at 12.0 to 10.2 V, and most still end standing. A
# servo's overload protection trips within a few seconds near stall.
ALL_SATURATION = 1.0  # s
REFUSED_OVERLAP, TOUCHING_OVERLAP = 0.006, 0.002  # m; those motions touch by up to 1.6 mm
# A robot that lies with folded limbs overlaps itself where its shapes are thicker than its links:
# by up to 17 mm in 384 falls that settled on the meshes of OP3's links.
IMPOSSIBLE_OVERLAP = 0.025  # m


class ReasonKind(Enum):
    """Effect of a reason on the verdict."""

    REFUSE = "refused"
    WARN = "warning"


@dataclass(frozen=True)
class Reason:
    """One finding of a preflight."""

    kind: ReasonKind
    joint: str | None
    """None if it is not about a single joint."""
    text: str

    def __str__(self) -> str:
        return f"joint '{self.joint}': {self.text}" if self.joint else self.text


@dataclass(frozen=True)
class Verdict:
    """Whether a plan may be played, and the reasons."""

    reasons: tuple[Reason, ...] = ()
    """All findings, refusals first."""
    falls = another_may_pass = False
    """What is known of a motion alone, as of `MotionVerdict`."""

    @property
    def passed(self) -> bool:
        """Return whether nothing is refused."""
        return not self.refusals

    @property
    def refusals(self) -> tuple[Reason, ...]:
        """Return the reasons that it must not be played."""
        return tuple(r for r in self.reasons if r.kind is ReasonKind.REFUSE)

    @property
    def warnings(self) -> tuple[Reason, ...]:
        """Return the reasons to be careful."""
        return tuple(r for r in self.reasons if r.kind is ReasonKind.WARN)

    def __str__(self) -> str:
        if not self.passed:
            return "preflight refused: " + "; ".join(map(str, self.refusals))
        warnings = "; ".join(map(str, self.warnings))
        return f"preflight passed, with warnings: {warnings}" if warnings else "preflight passed"


@dataclass(frozen=True)
class MotionVerdict(Verdict):
    """Whether a motion may be played, with the figures of its rollout."""

    figures: Figures = field(kw_only=True)

    @property
    def falls(self) -> bool:
        """Return whether the motion does not end as it should in the rollout."""
        return not self.figures.succeeded

    @property
    def another_may_pass(self) -> bool:
        """Return whether it is the motion that was refused, not the state of the robot."""
        is_overloaded = np.any(self.figures.longest_saturation > LONG_SATURATION)
        return self.falls or bool(is_overloaded) or self.figures.overlap_growth > REFUSED_OVERLAP


def preflight(
    world: World,
    motion: Motion,
    *,
    voltage: float,
    torque_limit: TorqueLimit = FULL_TORQUE,
    temperature: Array | float = AMBIENT_TEMPERATURE,
    start: Posture | None = None,
    balanced: bool = True,
) -> MotionVerdict:
    """Judge a motion with torque off, and report all problems at once.

    The motion is rolled out on a twin at this supply, through the guard, from the measured
    posture or else from its own first one; limits, speeds, heat and collisions are taken from
    the motion and from the rollout.

    Args:
        voltage: Supply at the servos [V].
        temperature: Present temperature of the servos [°C], (n,) or a number for all.
        start: Posture of the lying robot as measured; ``None`` where it is not yet.
        balanced: Whether a rise is played with feedback, as by `supervise_motion`.
    """
    robot = world.robot
    _check_input(voltage, temperature)
    torque_limit = torque_limit.on(robot)
    heat = np.broadcast_to(np.asarray(temperature, dtype=float), (robot.n,))
    figures = measure(world, motion, voltage, torque_limit, heat, start, balanced)
    reasons = [
        *_judge_supply(robot, voltage),
        *_judge_limits(robot, motion),
        *_judge_speed(robot, figures),
        *_judge_load(robot, motion, figures, torque_limit.value),
        *_judge_temperature(robot, heat, figures.end_temperature),
        *_judge_overlap(figures),
        *_judge_start(robot, motion, start),
    ]
    reasons.sort(key=lambda reason: reason.kind is ReasonKind.WARN)
    return MotionVerdict(tuple(reasons), figures=figures)


def preflight_stored(world: World, motion: Motion) -> MotionVerdict:
    """Judge a motion that is to be stored, at the nominal supply.

    A rise that falls with feedback to the ankles is judged without: so it is played.
    """
    voltage = world.robot.supply_voltage
    verdict = preflight(world, motion, voltage=voltage)
    if verdict.falls and motion.rises:
        return preflight(world, motion, voltage=voltage, balanced=False)
    return verdict


def preflight_robot(robot: Robot, voltage: float, temperature: Array) -> Verdict:
    """Judge the supply [V] and the temperatures of the servos [°C], (n,), without a motion."""
    return Verdict((*_judge_supply(robot, voltage), *_judge_temperature(robot, temperature)))


def _check_input(voltage: float, temperature: Array | float) -> None:
    problems = []
    if not 0.0 < voltage < math.inf:
        problems.append(f"voltage is {voltage:g} V, expected a finite number above 0 V")
    if not np.all(np.isfinite(temperature)):
        problems.append("temperature is not finite, expected finite numbers in °C")
    if problems:
        raise ValueError("; ".join(problems))


def _refuse(text: str, joint: str | None = None) -> Reason:
    return Reason(ReasonKind.REFUSE, joint, text)


def _warn(text: str, joint: str | None = None) -> Reason:
    return Reason(ReasonKind.WARN, joint, text)


def _judge_supply(robot: Robot, voltage: float) -> list[Reason]:
    if all(joint.servo.model.accepts_supply(voltage) for joint in robot.joints):
        return []
    lowest, highest = robot.supply_range
    remedy = (
        "charge the battery" if voltage < lowest else "use a battery that the servos are rated for"
    )
    expected = f"expected {lowest:.1f} to {highest:.1f} V"
    return [_refuse(f"the supply is {voltage:.1f} V, {expected}: {remedy}")]


def _judge_limits(robot: Robot, motion: Motion) -> list[Reason]:
    reasons = []
    for i, joint in enumerate(robot.joints):
        for name, angles, slack in (
            ("target", motion.joint_target[:, i], 1e-6),
            ("angle", motion.joint_pos[:, i], ANGLE_SLACK),
        ):
            beyond = np.maximum(joint.lower - angles, angles - joint.upper)
            worst = int(beyond.argmax())
            if beyond[worst] > slack:
                text = (
                    f"{name} {angles[worst]:+.3f} rad at {motion.time[worst]:.2f} s is outside "
                    f"[{joint.lower:+.3f}, {joint.upper:+.3f}] rad"
                )
                reasons.append(_refuse(text, joint.name))
    return reasons


def _judge_speed(robot: Robot, figures: Figures) -> list[Reason]:
    reasons = []
    speed = figures.target_speed
    for i in np.flatnonzero(speed > SPEED_SLACK * robot.max_velocity):
        text = (
            f"targets move at {speed[i]:.2f} rad/s, expected at most "
            f"{robot.max_velocity[i]:.2f} rad/s: the guard would change the motion"
        )
        reasons.append(_refuse(text, robot.joint_names[i]))
    at_supply = robot.max_velocity * figures.voltage / robot.nominal_voltage
    lagging = int(np.sum(speed > SPEED_SLACK * at_supply))
    if lagging and not reasons:
        worst = int((speed / at_supply).argmax())
        others = f"; so do {lagging - 1} other joints" if lagging > 1 else ""
        text = (
            f"targets move at {speed[worst]:.2f} rad/s, the servo does {at_supply[worst]:.2f} "
            f"rad/s without load at {figures.voltage:.1f} V and will lag{others}"
        )
        reasons.append(_warn(text, robot.joint_names[worst]))
    return reasons


def _judge_load(
    robot: Robot, motion: Motion, figures: Figures, torque_limit: float | None
) -> list[Reason]:
    reasons = []
    limited = "" if torque_limit is None else f" with {torque_limit:g} N·m"
    if not figures.succeeded:
        behind = f" behind {robot.supply_resistance:g} Ω" if robot.supply_resistance else ""
        at_supply = f"rolled out at {figures.voltage:.1f} V{behind}{limited}"
        remedy = ": raise --torque-limit" if limited else ""
        reasons.append(_refuse(f"{at_supply}, it does not end {describe_end(motion)}{remedy}"))
    for i, name in enumerate(robot.joint_names):
        longest, whole = figures.longest_saturation[i], figures.saturation[i]
        if longest > LONG_SATURATION:
            text = (
                f"has all the torque of this supply for {longest:.1f} s at a time, "
                f"expected at most {LONG_SATURATION:g} s: its overload protection may trip"
            )
            reasons.append(_refuse(text, name))
        elif whole > ALL_SATURATION:
            text = f"has all the torque of this supply for {whole:.1f} s: no reserve is left"
            reasons.append(_warn(text, name))
    return reasons


def _judge_temperature(robot: Robot, now: Array, then: Array | None = None) -> list[Reason]:
    """Judge the temperatures [°C], (n,), of the servos now and, if predicted, after the rise."""
    most = find_max_temperature(robot)
    expected = [f"expected at most {limit:.0f} °C: let it cool down" for limit in most]
    names, is_hot = robot.joint_names, now > most
    reasons = [
        _refuse(f"has {now[i]:.0f} °C, {expected[i]}", names[i]) for i in np.flatnonzero(is_hot)
    ]
    if then is not None:
        for i in np.flatnonzero(~is_hot & (then > most)):
            both = f"has {now[i]:.0f} °C and would have {then[i]:.0f} °C after the rise"
            reasons.append(_refuse(f"{both}, {expected[i]}", names[i]))
    return reasons


def _judge_overlap(figures: Figures) -> list[Reason]:
    reasons = []
    lying, growth = figures.start_overlap, figures.overlap_growth
    text = f"the robot presses {1000.0 * growth:.1f} mm into itself"
    if lying > TOUCHING_OVERLAP:
        text += ", beyond how it lies"
    if growth > REFUSED_OVERLAP:
        reasons.append(_refuse(f"{text}, expected at most {1000.0 * REFUSED_OVERLAP:.0f} mm"))
    elif growth > TOUCHING_OVERLAP:
        reasons.append(_warn(text))
    if lying > IMPOSSIBLE_OVERLAP:
        text = (
            f"the measured posture is {1000.0 * lying:.0f} mm inside itself, expected at most "
            f"{1000.0 * IMPOSSIBLE_OVERLAP:.0f} mm: check the zeros with `getup doctor`"
        )
        reasons.append(_refuse(text))
    return reasons


def _judge_start(robot: Robot, motion: Motion, start: Posture | None) -> list[Reason]:
    if start is None:
        return []
    reasons = []
    tilt = measure_tilt(start.orientation, motion.orientation[0])
    if tilt > FAR_TILT:
        text = (
            f"the robot lies {math.degrees(tilt):.0f}° from where the motion "
            f"begins, expected at most {math.degrees(FAR_TILT):.0f}°: it lies "
            f"{classify(start.orientation) or 'on no side'}, the motion begins {motion.start_class}"
            ": turn it over, or play another motion"
        )
        reasons.append(_refuse(text))
    apart = start.joint_pos - motion.joint_pos[0]
    worst = int(np.abs(apart).argmax())
    if abs(apart[worst]) > FAR_ANGLE:
        text = (
            f"is {apart[worst]:+.2f} rad from the motion's first posture: "
            "the player moves it there first"
        )
        reasons.append(_warn(text, robot.joint_names[worst]))
    return reasons
