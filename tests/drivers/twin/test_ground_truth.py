"""Ground truth, in postures where the answer is known."""

import math

import mujoco
import numpy as np
import pytest

from drivers import Command, Twin
from humanoid_getup.simulation.world import World
from robots import Posture, quaternion


def place(twin, z, orientation=quaternion.IDENTITY, joint_pos=None):
    n = twin.robot.n
    twin.place(
        Posture(
            position=np.array([0.0, 0.0, z]),
            orientation=orientation,
            joint_pos=np.zeros(n) if joint_pos is None else joint_pos,
        )
    )
    return twin.truth


def names(truth):
    return [truth.model.body(body).name for body in truth.touching_bodies]


def test_a_standing_op3_stands(op3):
    twin = Twin(op3)
    command = Command.position(op3, op3.standing.joint_pos)
    with twin:
        for _ in range(125):
            twin.read()
            twin.write(command)
            assert set(names(twin.truth)) == {"l_ank_roll_link", "r_ank_roll_link"}
    assert math.degrees(quaternion.tilt(twin.truth.posture.orientation)) < 5.0
    # The facts' own simulation of this stance settles with the hips at 0.256 m.
    assert twin.truth.posture.position[2] == pytest.approx(0.256, abs=2e-3)
    assert twin.truth.self_penetration == 0.0
    assert twin.truth.ground_penetration < 1e-3


def test_penetration_of_the_ground_is_measured(tiny):
    truth = place(Twin(tiny), 0.1 - 0.004)
    assert truth.ground_penetration == pytest.approx(0.004)
    # Four corners of each foot.
    assert sorted(names(truth)) == ["l_leg"] * 4 + ["r_leg"] * 4


def test_self_contact_is_measured_and_is_no_contact_with_the_world(op3):
    folded = op3.standing.joint_pos.copy()
    for joint, angle in (("l_sho_roll", 1.6), ("l_el", -2.4), ("l_sho_pitch", 0.0)):
        folded[op3.joint_names.index(joint)] = angle
    folded[op3.joint_names.index("l_hip_roll")] = 0.6  # the left leg swings into the right
    truth = place(Twin(op3), 1.0, joint_pos=folded)
    assert truth.self_penetration > 0.0
    assert truth.ground_penetration == 0.0
    assert names(truth) == []


def test_an_obstacle_is_part_of_the_world(tiny):
    spec = tiny.spec()
    step = spec.worldbody.add_body(name="step", pos=[0.0, 0.07, 0.05])
    step.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.1, 0.02, 0.05])
    twin = Twin(World(tiny, model=spec.compile()))
    # The left sole on the step at 0.1 m: only a foot touches.
    assert set(names(place(twin, 0.199))) == {"l_leg"}
    # Sunk so far that the torso, from y = -0.05 to 0.05, is over the step's edge, too.
    twin.model.geom_size[twin.model.body("step").geomadr[0]][1] = 0.04
    assert "torso" in names(place(twin, 0.12))
