"""Lying postures: which class a posture belongs to, and how falls make them."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import mujoco
import numpy as np

from humanoid_getup.ground import lowest_point
from humanoid_getup.rehearsal import Conditions, Rehearsal
from humanoid_getup.stage import Stage, place
from robots import Posture, Robot, rotation
from robots.rotation import Array

CLASSES = ("supine", "prone", "left", "right")
DROP_HEIGHT = 0.02  # m under the lowest point
SETTLE_TIME = 3.0  # s
STILL_SPEED = 0.02  # rad/s and m/s, over the last quarter of a second
SPAWN_OVERLAP = 0.001  # m of self-collision that a drop may begin with
BATCH = 24
MOST_BATCHES = 400
MOST_SAMPLES = 10_000


class FallError(ValueError):
    """Falls do not make the postures that were asked for."""


@dataclass(frozen=True, kw_only=True)
class Fall:
    """A robot that fell and lies still."""

    posture: Posture
    start_class: str


def classify(orientation: Array) -> str | None:
    """Class a torso orientation by gravity: supine, prone, left or right side down.

    Returns None where gravity points mostly along the torso: upright or head down.
    """
    x, y, z = rotation.gravity_in_body(orientation)
    if abs(z) > max(abs(x), abs(y)):
        return None
    if abs(x) >= abs(y):
        return "supine" if x < 0.0 else "prone"
    return "left" if y > 0.0 else "right"


def sample_falls(stage: Stage, counts: dict[str, int], rng: np.random.Generator) -> list[Fall]:
    """Drop limp robots until every class has its count.

    Random joints inside the limits, in any orientation, dropped limp and settled until
    still; then classed, and rejected where the class is full or the robot does not lie.

    Args:
        stage: Robot and scene.
        counts: How many of each class; "lateral" stands for left or right.
        rng: Source of the falls; the same one gives the same falls.

    Raises:
        FallError: if a class does not come up.
    """
    rehearsal = Rehearsal(stage, BATCH)
    wanted = dict(counts)
    falls: list[Fall] = []
    for batch in itertools.count():
        if not any(wanted.values()):
            break
        if batch == MOST_BATCHES:
            missing = ", ".join(f"{count} {name}" for name, count in wanted.items() if count)
            raise FallError(
                f"robot '{stage.robot.name}' does not come to lie in every class: "
                f"{missing} missing after {batch * BATCH} falls"
            )
        for posture in _drop(rehearsal, rng):
            found = classify(posture.orientation)
            if found is None:
                continue
            key = "lateral" if found in ("left", "right") and "lateral" in wanted else found
            if wanted.get(key, 0) > 0:
                wanted[key] -= 1
                falls.append(Fall(posture=posture, start_class=found))
    order = list(counts)
    return sorted(falls, key=lambda fall: order.index(_counted_as(fall.start_class, counts)))


def _counted_as(start_class: str, counts: dict[str, int]) -> str:
    return start_class if start_class in counts else "lateral"


def _drop(rehearsal: Rehearsal, rng: np.random.Generator) -> list[Posture]:
    """Drop one batch of robots; return those that lie still."""
    stage = rehearsal.stage
    robot, model = stage.robot, stage.model
    data = mujoco.MjData(model)
    starts = np.array([sample_drop(robot, model, data, rng) for _ in range(BATCH)])
    limp = Conditions.nominal(stage, BATCH, torque_limit=0.0)
    cycles = round(SETTLE_TIME / robot.control_period)
    targets = np.zeros((BATCH, cycles, robot.n))
    qpos = rehearsal.play(starts, targets, limp).qpos
    recent = round(0.25 / robot.control_period)
    moved = np.abs(np.diff(qpos[:, -recent:], axis=1)).max(axis=(1, 2)) / robot.control_period
    return [
        read_posture(robot, model, q)
        for q, v in zip(qpos[:, -1], moved, strict=True)
        if v < STILL_SPEED
    ]


def read_posture(robot: Robot, model: mujoco.MjModel, qpos: Array) -> Posture:
    """Read a posture out of MuJoCo positions (nq,)."""
    layout = robot.layout(model)
    root = layout.root_qpos
    return Posture(
        position=qpos[root : root + 3].copy(),
        orientation=rotation.normalise(qpos[root + 3 : root + 7]),
        joint_pos=np.clip(qpos[layout.qpos], robot.lower, robot.upper),
    )


def sample_drop(
    robot: Robot, model: mujoco.MjModel, data: mujoco.MjData, rng: np.random.Generator
) -> Array:
    """Sample joints anywhere in their range and any orientation, free of self-collision.

    Args:
        robot: Robot.
        model: Its compiled world.
        data: Scratch space of that world.
        rng: Source of the sample.

    Returns:
        MuJoCo positions just above the ground, (nq,).

    Raises:
        FallError: if the robot presses into itself wherever its joints are.
    """
    for _ in range(MOST_SAMPLES):
        posture = Posture(
            position=np.array([0.0, 0.0, 1.0]),
            orientation=rotation.normalise(rng.normal(size=4)),
            joint_pos=rng.uniform(robot.lower, robot.upper),
        )
        data.qpos[:] = place(robot, model, posture)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_collision(model, data)
        if all(contact.dist > -SPAWN_OVERLAP for contact in data.contact):
            qpos = data.qpos.copy()
            qpos[robot.layout(model).root_qpos + 2] += DROP_HEIGHT - lowest_point(model, qpos)
            return qpos
    raise FallError(f"robot '{robot.name}' presses into itself in {MOST_SAMPLES} random postures")
