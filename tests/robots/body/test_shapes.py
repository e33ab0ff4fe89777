"""A fitted shape holds its points and little besides; links overlap as on a twin."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers import Twin
from humanoid_getup.simulation.world import World
from robots import Posture, Robot, quaternion
from robots.body.overlap import measure_pair_overlaps, overlaps_at
from robots.body.shapes import Shape, fit_shape
from robots.kinematics import place
from robots.quaternion import Array

GEOM = mujoco.mjtGeom
FEW = settings(max_examples=30)


def measure_distance(shape: Shape, points: Array) -> Array:
    """Measure how far points are outside a box or capsule [m], (p,); negative inside."""
    own = quaternion.rotate(quaternion.inverse(shape.orientation), points - shape.position)
    if shape.kind == GEOM.mjGEOM_BOX:
        return np.max(np.abs(own) - shape.size, axis=1)
    radius, half = shape.size[:2]
    own[:, 2] -= np.clip(own[:, 2], -half, half)
    return np.linalg.norm(own, axis=1) - radius


@FEW
@given(
    seed=st.integers(0, 10_000),
    count=st.integers(4, 60),
    extent=st.tuples(*[st.floats(0.0, 0.3)] * 3),
)
def test_a_shape_holds_its_points(seed: int, count: int, extent):
    points = np.random.default_rng(seed).normal(size=(count, 3)) * extent
    shape = fit_shape(points)
    assert np.isfinite(shape.size).all()
    assert measure_distance(shape, points).max() < 1e-9


@FEW
@given(
    size=st.tuples(*[st.floats(0.01, 0.2)] * 3),
    axis=st.sampled_from(np.eye(3).tolist()),
    steps=st.integers(0, 17),
)
def test_a_box_is_fitted_as_itself(size, axis, steps: int):
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * size
    turn = quaternion.from_axis_angle(np.array(axis), np.radians(5.0 * steps))
    shape = fit_shape(quaternion.rotate(turn, corners) + np.array([0.1, 0.2, 0.3]))
    assert shape.position == pytest.approx([0.1, 0.2, 0.3], abs=1e-9)
    assert measure_volume(shape) <= 8.0 * np.prod(size) * 1.1 + 1e-12


def measure_volume(shape: Shape) -> float:
    if shape.kind == GEOM.mjGEOM_BOX:
        return float(8.0 * np.prod(shape.size))
    radius, half = shape.size[:2]
    return float(np.pi * radius**2 * (2.0 * half + 4.0 / 3.0 * radius))


@FEW
@given(
    size=st.tuples(st.floats(0.04, 0.1), st.floats(0.03, 0.06)),
    bracket=st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(0.03, 0.06)),
    tilt=st.integers(-3, 3),
)
def test_the_box_of_a_foot_lies_flush_with_its_sole(size, bracket, tilt: int):
    """A plate with a bracket on it: the smallest box may lie across it."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (0, 0.004)])
    plate = corners * [*size, 1.0]
    x, y, high = bracket
    top = 0.005 * corners[:, :2] + np.array([x, y]) * size
    points = np.concatenate([plate, np.column_stack([top, np.full(8, high)])])
    turn = quaternion.from_axis_angle(np.array([1.0, 0.0, 0.0]), np.radians(5.0 * tilt))
    shape = fit_shape(quaternion.rotate(turn, points))
    axes = [quaternion.rotate(shape.orientation, axis) for axis in np.eye(3)]
    down = quaternion.rotate(turn, np.array([0.0, 0.0, 1.0]))
    assert max(abs(axis @ down) for axis in axes) == pytest.approx(1.0, abs=1e-6)


def find_overlaps(world: World, posture: Posture) -> Array:
    qpos = place(world.robot, world.model, posture)
    return overlaps_at(world.model, qpos, mujoco.MjData(world.model))


def cross(op3: Robot, seed: int) -> Posture:
    rng = np.random.default_rng(seed)
    return Posture(
        position=np.array([0.0, 0.0, 1.0]),
        orientation=quaternion.normalize(rng.normal(size=4)),
        joint_pos=rng.uniform(op3.lower, op3.upper),
    )


def test_the_deepest_pair_is_as_deep_as_the_robot_is_in_itself(world: World, op3: Robot):
    for seed in range(8):
        posture = cross(op3, seed)
        twin, depth = Twin(world, posture), find_overlaps(world, posture)
        assert depth.max() == pytest.approx(twin.truth.self_penetration, abs=1e-12), seed
        by_twin = measure_pair_overlaps(twin.truth.model, twin.truth.data)
        np.testing.assert_array_equal(depth, by_twin)
        np.testing.assert_array_equal(depth, np.triu(depth, k=1))


def test_overlap_is_of_the_links_that_cross_and_not_of_the_ground(world: World, op3: Robot):
    joint_pos = op3.standing.joint_pos.copy()
    in_the_ground = replace(op3.standing, position=np.zeros(3))
    assert find_overlaps(world, in_the_ground).max() == 0.0
    joint_pos[op3.joint_names.index("l_hip_roll")] = 0.3
    joint_pos[op3.joint_names.index("r_hip_roll")] = -0.3
    depth = find_overlaps(world, replace(in_the_ground, joint_pos=joint_pos))
    pairs = {tuple(world.model.body(link).name for link in pair) for pair in np.argwhere(depth)}
    assert pairs
    assert all(first.startswith("l_") and second.startswith("r_") for first, second in pairs)
