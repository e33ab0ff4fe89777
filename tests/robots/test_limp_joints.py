"""Limp joints: described, refused where wrong, and never driven, in any physics."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from recording_backend import RecordingBackend
from spoiling import complaint, spoil

from drivers import Command, GuardLimits, SafetyGuard, Twin
from drivers.servo_units import ServoUnits
from humanoid_getup.experiments.disturbances import Scenarios
from humanoid_getup.experiments.rollouts import play
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import list_sides
from humanoid_getup.simulation.world import World
from robots import Robot, load_robot
from robots.kinematics import place

PERIOD = "control_period = 0.008"
SHOULDER = "l_sho_pitch"


@pytest.fixture
def limp(tiny: Robot) -> Robot:
    """The tiny robot with a limp left hip."""
    return replace(tiny, limp_joints=("l_hip",))


@pytest.fixture
def limp_op3(op3: Robot) -> Robot:
    return replace(op3, limp_joints=(SHOULDER,))


def test_limp_joints_of_a_description_have_no_strength(own_robot: Path, tiny: Robot):
    assert tiny.strength.tolist() == [1.0, 1.0]
    spoil(own_robot, PERIOD, f'{PERIOD}\nlimp_joints = ["l_hip"]')
    assert load_robot(own_robot).strength.tolist() == [0.0, 1.0]
    rows = "[[couplings]]\njoints = ['l_hip', 'r_hip']\nmatrix = [[0.9, -0.5], [0.6, 0.7]]\n"
    file = own_robot / "robot.toml"
    file.write_text(file.read_text() + rows)
    words = "limp_joints: 'l_hip' is coupled, expected a joint with a servo of its own"
    assert words in complaint(own_robot)


@pytest.mark.parametrize("own_limits", [False, True])
def test_the_guard_never_drives_a_limp_joint_and_counts_no_clip(
    limp: Robot, tiny: Robot, *, own_limits: bool
):
    """Whatever torque a user's own limits permit there."""
    limits = GuardLimits.of(tiny) if own_limits else None  # of a robot without limp joints
    with SafetyGuard(RecordingBackend(limp), limits) as guard:
        for _ in range(3):
            sent = guard.write(Command.position(limp, np.full(2, 0.01)))
    assert sent.torque_limit[0] == 0.0
    assert sent.torque_limit[1] == limp.max_torque[1]
    assert sent.joint_pos[0] == 0.0, "its target is its measured angle"
    assert guard.clips.torque.tolist() == [0, 0]


def test_twin_and_rollouts_agree_on_a_robot_with_a_limp_joint(limp_op3: Robot):
    motion = Motion.load(limp_op3.folder / "motions" / "supine_sit_up_gentle.npz")
    world, joint = World(limp_op3), limp_op3.joint_names.index(SHOULDER)
    start = motion.posture(0)
    targets = np.repeat(motion.joint_pos[:1], 60, axis=0)
    targets[:, joint] += np.linspace(0.0, 0.5, 60)
    targets = ServoUnits(limp_op3).round_goal(targets)
    with Twin(world, start) as twin:
        sent = [twin.write(Command.position(limp_op3, target)) for target in targets]
    begun = Scenarios.nominal(world, place(limp_op3, world.model, start))
    record = play(world, begun, targets[None])
    assert {command.torque_limit[joint] for command in sent} == {0.0}
    assert not record.torque[0, :, joint].any()
    assert twin.truth.qpos == pytest.approx(record.qpos[0, -1], abs=1e-9)


def test_a_limp_robot_is_searched_from_the_right_too_and_its_plans_are_kept_apart(
    op3: Robot, limp_op3: Robot
):
    assert World(op3).content != World(limp_op3).content
    assert list_sides(op3) == ("supine", "prone", "left")
    assert list_sides(limp_op3)[-1] == "right"
    both = replace(op3, limp_joints=(SHOULDER, "r_sho_pitch"))
    assert list_sides(both) == ("supine", "prone", "left")
