"""Squats: how deep can a robot crouch on flat soles in balance, and is it strong enough there?"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from humanoid_getup.motions.limbs import Limbs
from humanoid_getup.robot_check.finding import Finding
from humanoid_getup.robot_check.statics import Statics
from robots import Robot
from robots.model_import.stance import Body, StanceSolver
from robots.model_import.symmetry import Mirror
from robots.quaternion import Array

EXTENSIONS = np.arange(0.95, 0.24, -0.05)
"""Shares of the stretched leg to which a robot is asked to crouch, in turn."""
DEEP_ENOUGH = 0.75  # share of standing neck height to which rises of OP3 crouch at least
STRONG_ENOUGH = 0.5  # share of stall torque that leaves a servo as much to move with
MOST_LEAN = np.radians(50.0)  # of the torso; beyond, a robot folds rather than crouches
GAP = 3  # extensions in a row without a balanced posture: deeper ones are another way to crouch


@dataclass(frozen=True, kw_only=True, eq=False)
class Squat:
    """A balanced posture on flat soles."""

    joint_pos: Array
    """[rad], (n,)"""
    neck_share: float
    """Height of the neck over that of the stance."""
    torque: Array
    """Torques that hold it [N·m], (n,)."""


def list_squats(robot: Robot) -> list[Squat]:
    """List balanced squats from high to deep; empty if there is none."""
    body, order = _describe(robot)
    before = np.zeros(body.model.njnt - 1)
    before[order] = robot.standing.joint_pos
    solver, statics = StanceSolver(body, before), Statics(robot)
    squats: list[Squat] = []
    missed = 0
    for extension in EXTENSIONS:
        stance = solver.solve(float(extension), leaning=True)
        angles = stance.joint_pos[order]
        if not stance.is_solved or statics.measure_lean(angles) > MOST_LEAN:
            missed += bool(squats)
            if missed >= GAP:
                break
            continue
        missed = 0
        squats.append(
            Squat(
                joint_pos=angles,
                neck_share=statics.measure_neck(angles),
                torque=statics.measure_torques(angles),
            )
        )
    return squats


def check_squats(robot: Robot, squats: list[Squat]) -> Iterator[Finding]:
    """Find whether a robot can crouch deep enough, and which joints are too weak for it."""
    if not squats:
        yield Finding(
            level="warning",
            subject="squat",
            text="no balanced posture on flat soles was found, so strength is not checked",
            remedy="check the sole sites, and the ranges of hips, knees and ankles",
        )
        return
    deepest = min(squats, key=lambda squat: squat.neck_share)
    is_deep = deepest.neck_share <= DEEP_ENOUGH
    yield Finding(
        level="ok" if is_deep else "warning",
        subject="squat",
        text=f"crouches in balance down to {deepest.neck_share:.0%} of its neck height"
        + ("" if is_deep else f", expected at most {DEEP_ENOUGH:.0%}")
        + _name_stops(robot, deepest),
        remedy="" if is_deep else "widen the ranges that stop it, if the robot can",
    )
    yield from _check_strength(robot, squats)


def _name_stops(robot: Robot, squat: Squat) -> str:
    near = np.minimum(squat.joint_pos - robot.lower, robot.upper - squat.joint_pos) < 0.05
    legs = {k for name, limb in Limbs(robot).all.items() if "leg" in name for k in limb.joints}
    names = [robot.joint_names[k] for k in np.flatnonzero(near) if k in legs]
    return f"; at the end of their ranges: {', '.join(names)}" if names else ""


def _check_strength(robot: Robot, squats: list[Squat]) -> Iterator[Finding]:
    """Compare the greatest torque of every joint over all squats with its servo's."""
    need = np.max([squat.torque for squat in squats], axis=0)
    share = need / robot.max_torque
    for k in np.argsort(-share):
        if share[k] < STRONG_ENOUGH:
            break
        model = robot.joints[k].servo.model.name
        yield Finding(
            level="fault" if share[k] > 1.0 else "warning",
            subject=f"joint '{robot.joint_names[k]}'",
            text=f"needs {need[k]:.2f} N·m to hold a squat, {share[k]:.0%} of the {model}'s "
            f"{robot.max_torque[k]:.2f} N·m, expected at most {STRONG_ENOUGH:.0%}",
            remedy=f"a servo of {need[k] / STRONG_ENOUGH:.1f} N·m would do; or avoid deep squats",
        )
    worst = int(np.argmax(share))
    if share[worst] < STRONG_ENOUGH:
        yield Finding(
            level="ok",
            subject="squat",
            text=f"the most strained joint is '{robot.joint_names[worst]}' with {need[worst]:.2f} "
            f"N·m, {share[worst]:.0%} of its stall torque",
        )


def _describe(robot: Robot) -> tuple[Body, np.ndarray]:
    """Describe a robot for the solver, and where its joints are among the model's hinges, (n,)."""
    limbs = Limbs(robot)
    model = limbs.model
    order = np.array([model.joint(name).id - 1 for name in robot.joint_names])
    count = model.njnt - 1
    index, sign = np.arange(count), np.ones(count)
    index[order] = order[robot.mirror_index]
    sign[order] = robot.mirror_sign

    def pair(kind: str) -> tuple[tuple[int, ...], tuple[int, ...]]:
        left, right = (limbs.all[f"{side}_{kind}"] for side in ("left", "right"))  # type: ignore[index]
        return (
            tuple(int(order[k]) for k in left.joints),
            tuple(int(order[k]) for k in right.joints),
        )

    has_arms = {"left_arm", "right_arm"} <= limbs.all.keys()
    soles = [limbs.all[name].sole for name in ("left_leg", "right_leg")]
    return (
        Body(
            model=model,
            mirror=Mirror(index, sign, ()),
            legs=pair("leg"),
            arms=(pair("arm"),) if has_arms else (),
            soles=(model.site(soles[0]).name, model.site(soles[1]).name),
        ),
        order,
    )
