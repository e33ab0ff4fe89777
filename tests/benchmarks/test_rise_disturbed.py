"""Disturbed worlds: each differs by what it says, and every strategy meets the same ones."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
import rise_disturbed
from disturbed_worlds import (
    FEEDBACK,
    OPEN_LOOP,
    WeakTwin,
    WorldChange,
    turn_head,
)
from nonempty import nonempty
from rise_disturbed import CHANGES, DisturbedOptions, OtherChange

from drivers import Command, Twin
from humanoid_getup.experiments.falls import sample_fall
from humanoid_getup.simulation.world import World
from robots import quaternion
from robots.kinematics import center_of_mass
from robots.robot import Robot


@pytest.fixture(scope="module")
def fall(world: World):
    return sample_fall(world, "prone", seed=3)


def mass_and_center(world: World) -> tuple[float, np.ndarray]:
    robot, model, stand = world.robot, world.model, world.robot.standing
    center = center_of_mass(
        robot, model, stand.position, stand.orientation, stand.joint_pos[np.newaxis]
    )
    return float(model.body_subtreemass[model.body(robot.torso).id]), center[0]


def test_masses_of_a_world_are_changed_by_what_is_said(world: World):
    """A load adds its mass behind the robot; its center of mass moves with that of the torso."""
    mass, center = mass_and_center(world)
    loaded, moved = mass_and_center(OtherChange(load=0.3).build_world(world, 0.0))
    assert loaded == pytest.approx(mass + 0.3)
    assert moved[0] < center[0] - 0.005
    torso = world.model.body(world.robot.torso).id
    share = world.model.body_mass[torso] / world.model.body_subtreemass[torso]
    _, moved = mass_and_center(OtherChange(com_shift=0.005).build_world(world, 0.0))
    assert moved[0] - center[0] == pytest.approx(0.005 * share, rel=0.02)
    heavier = WorldChange(mass=1.1).build_world(world, 0.0).model
    assert heavier.body_mass == pytest.approx(1.1 * world.model.body_mass)


@pytest.mark.parametrize("case", ["slope -5 deg", "step of 2 cm"])
def test_a_robot_settles_on_the_ground_that_its_judge_measures_from(world: World, fall, case):
    trial = CHANGES[case].disturb(world, fall, [5, 0])
    twin = Twin(trial.world, trial.start)
    with twin:
        for _ in range(150):
            twin.write(Command.limp(twin.robot.n))
    truth, support = twin.truth, trial.world.scene.support
    points = twin.data.contact.pos[: twin.data.ncon]
    touching = np.abs(points[:, 2] - support(points)) < 0.003
    assert truth.ground_penetration < 0.005
    assert touching.sum() >= 3


def test_a_start_is_turned_by_its_angle_and_lies_on_the_ground(world: World, fall):
    disturbance = WorldChange(start_angle=math.radians(10.0))
    flat = turn_head(fall.posture)
    start = disturbance.lay(world, flat, np.random.default_rng(0))
    angle = quaternion.angle_between(start.orientation, flat.orientation)
    assert float(angle) == pytest.approx(math.radians(10.0), abs=1e-6)
    assert np.all(start.joint_pos >= world.robot.lower)
    assert np.all(start.joint_pos <= world.robot.upper)


def test_a_weak_servo_makes_its_share_of_torque_and_tells_nothing(op3: Robot, world: World):
    strength = np.ones(op3.n)
    strength[[0, 3]] = 0.0, 0.6
    twin = WeakTwin(world, op3.standing, strength, None)
    command = Command.position(op3, op3.standing.joint_pos + 1.5)
    with twin:
        sent = twin.write(command)
        for _ in range(3):
            twin.write(command)
    torque = np.abs(twin.truth.joint_torque)
    assert torque[0] == 0.0
    assert torque[3] <= 0.6 * op3.max_torque[3] + 1e-9
    assert sent.torque_limit == pytest.approx(op3.max_torque)
    assert sent.gain_scale == pytest.approx(command.gain_scale)


def test_the_same_seed_draws_the_same_disturbances(world: World, fall):
    for name, disturbance in nonempty(CHANGES.items()):
        one, other = (disturbance.disturb(world, fall, [5, 1]) for _ in range(2))
        assert np.array_equal(one.strength, other.strength), name
        assert np.array_equal(one.start.joint_pos, other.start.joint_pos), name
        assert np.array_equal(one.world.model.geom_pos, other.world.model.geom_pos), name


@pytest.mark.slow
def test_plans_meet_the_same_falls_in_every_world(tmp_path: Path):
    file = tmp_path / "disturbed.json"
    options = DisturbedOptions(n=1, seed=4, cases=("supply 11.0 V",), policies=(), json=file)
    rise_disturbed.main(options)
    result = json.loads(file.read_text())
    assert (result["n"], len(result["rises"])) == (3, 6)
    for way in (OPEN_LOOP, FEEDBACK):
        ours = [rise for rise in result["rises"] if rise["way"] == way]
        summary = result["cases"][f"supply 11.0 V: {way}"]
        assert [rise["fall"] for rise in ours] == [0, 1, 2]
        assert summary["stood"] == sum(rise["stood"] for rise in ours)
        assert summary["refused"] + sum(rise["attempts"] for rise in ours) == 3
