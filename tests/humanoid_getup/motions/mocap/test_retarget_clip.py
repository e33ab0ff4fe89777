"""Clips of motion capture on a robot: bodies in them, laws, and a clip of a robot's own motion."""

import math
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from paths import SHARED
from scipy.spatial.transform import Rotation

from humanoid_getup.clips.clip import Clip, read_body
from humanoid_getup.clips.clip_file import read_clip
from humanoid_getup.motions.retarget_clip import ClipRetargeter
from robots import Robot, load_robot, quaternion
from robots.kinematics import lowest_points, place_postures

CMU = SHARED / "mocap" / "cmu"
PERIOD = 0.04  # s

# Where a clip's joints are on the human: the body, and whether at its sole.
JOINTS = {
    "LeftUpLeg": "l_thigh",
    "LeftLeg": "l_shank",
    "LeftFoot": "l_foot",
    "LeftArm": "l_upper_arm",
    "LeftForeArm": "l_forearm",
    "LeftHand": "l_hand",
    "Spine1": "spine",
    "Neck": "neck",
}


@pytest.fixture(scope="module")
def human() -> Robot:
    return load_robot("human")


@pytest.fixture(scope="module")
def retargeter(human: Robot) -> ClipRetargeter:
    return ClipRetargeter(human)


def make_clip(human: Robot, joint_pos: np.ndarray, orientation: np.ndarray) -> Clip:
    """Record where the joints of a human are, as a capture system would; z is up."""
    model = human.spec().compile()
    position = np.zeros((len(joint_pos), 3))
    qpos = place_postures(human, model, position, orientation, joint_pos)
    qpos[:, 2] -= lowest_points(model, qpos)
    upright = np.concatenate([[0.0, 0.0, 1.0], quaternion.IDENTITY, np.zeros(human.n)])
    rest = record(model, upright[None])
    return Clip(
        file=Path("own.bvh"),
        period=PERIOD,
        joints=record(model, qpos),
        rest={name: rows[0] for name, rows in rest.items()},
    )


def record(model: mujoco.MjModel, qpos: np.ndarray) -> dict[str, np.ndarray]:
    data, rows = mujoco.MjData(model), []
    for row in qpos:
        data.qpos[:] = row
        mujoco.mj_kinematics(model, data)
        rows.append({name: data.xpos[model.body(body).id].copy() for name, body in list_bodies()})
        for side, name in (("l", "Left"), ("r", "Right")):
            foot = data.geom_xpos[model.geom(f"{side}_sole").id]
            axes = data.geom_xmat[model.geom(f"{side}_sole").id].reshape(3, 3)
            half = model.geom_size[model.geom(f"{side}_sole").id]
            rows[-1][f"{name}ToeBase"] = foot + axes @ [half[0], 0.0, -half[2]]
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def list_bodies() -> list[tuple[str, str]]:
    mirrored = {
        name.replace("Left", "Right"): "r" + body[1:]
        for name, body in JOINTS.items()
        if "Left" in name
    }
    return [*JOINTS.items(), *mirrored.items()]


def move(human: Robot, count: int = 26, **degrees: float) -> np.ndarray:
    """Make a movement (T, n) from the zero posture to angles by name, both sides alike."""
    goal = np.zeros(human.n)
    for name, angle in degrees.items():
        for joint in (name, f"l_{name}", f"r_{name}"):
            if joint in human.joint_names:
                goal[human.joint_names.index(joint)] = math.radians(angle)
    share = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, count))
    return share[:, None] * goal


@pytest.fixture(scope="module")
def squat(human: Robot) -> Clip:
    angles = move(human, hip_pitch=-80, knee=110, ankle_pitch=-30, sho_pitch=-70, elbow=-60)
    pitch = np.radians(np.linspace(0.0, 25.0, len(angles)))
    return make_clip(human, angles, quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), pitch))


def test_a_clip_of_the_robots_own_motion_comes_back_as_that_motion(human, retargeter, squat):
    found = retargeter.retarget(squat, name="own")
    went = move(human, hip_pitch=-80, knee=110, ankle_pitch=-30, sho_pitch=-70, elbow=-60)
    motion, names = found.motion, human.joint_names
    at = np.searchsorted(motion.time, np.linspace(0.0, motion.duration, len(went)) - 1e-6)
    bends = [i for i, n in enumerate(names) if n.split("_", 1)[-1] in ("hip_pitch", "knee")]
    bends += [i for i, n in enumerate(names) if n.split("_", 1)[-1] in ("ankle_pitch", "elbow")]
    assert np.degrees(np.abs(motion.joint_pos[at] - went)[:, bends]).max() < 3.0
    assert math.degrees(found.mean_angle) < 1.0
    tilt = np.degrees(quaternion.tilt(motion.orientation[at]))
    assert tilt == pytest.approx(np.linspace(0.0, 25.0, len(went)), abs=1.0)


def test_a_clip_of_a_body_twice_as_large_takes_less_time_by_the_root_of_two(retargeter, squat):
    large = replace(
        squat,
        joints={name: 2.0 * rows for name, rows in squat.joints.items()},
        rest={name: 2.0 * row for name, row in squat.rest.items()},
    )
    one, other = (retargeter.retarget(clip, name="own") for clip in (squat, large))
    share = other.motion.duration / other.slowdown * one.slowdown / one.motion.duration
    assert share == pytest.approx(1.0 / math.sqrt(2.0), rel=0.02)  # to a control period
    assert other.motion.joint_pos[-1] == pytest.approx(one.motion.joint_pos[-1], abs=1e-6)


def test_a_mirrored_clip_becomes_the_mirrored_motion(human, retargeter):
    angles = move(human)
    angles[:, human.joint_names.index("l_hip_pitch")] = np.linspace(0.0, -1.0, len(angles))
    angles[:, human.joint_names.index("l_knee")] = np.linspace(0.0, 1.5, len(angles))
    upright = np.tile(quaternion.IDENTITY, (len(angles), 1))
    clips = [make_clip(human, a, upright) for a in (angles, human.mirror_joints(angles))]
    one, other = (retargeter.retarget(clip, name="own").motion for clip in clips)
    assert other.joint_pos == pytest.approx(human.mirror_joints(one.joint_pos), abs=0.02)


def test_a_short_clip_is_slowed_down_to_its_servos_and_a_part_is_as_long_as_asked_for(
    human, retargeter, squat
):
    found = retargeter.retarget(replace(squat, period=PERIOD / 10), name="fast")
    speed = np.abs(np.diff(found.motion.joint_pos, axis=0)) / human.control_period
    assert found.slowdown > 1.5
    assert (speed <= human.max_velocity).all()
    part = retargeter.retarget(squat, name="own", begin=0.4, end=0.8)
    assert part.motion.provenance["from_s"] == pytest.approx(0.4)
    assert part.motion.provenance["to_s"] == pytest.approx(0.8)
    assert part.motion.duration / part.slowdown == pytest.approx(0.4, rel=0.2)


@pytest.mark.parametrize("lost", ["LeftLeg", "Neck", "LeftArm"])
def test_a_clip_without_a_joint_of_a_human_is_refused_by_that_joint(retargeter, squat, lost):
    rows = {name: row for name, row in squat.joints.items() if name != lost}
    with pytest.raises(ValueError, match=f"it has no .*{lost}"):
        retargeter.retarget(replace(squat, joints=rows), name="own")


@pytest.mark.skipif(not CMU.exists(), reason="needs the clips in shared/mocap")
@pytest.mark.parametrize("name", [pytest.param("human", marks=pytest.mark.slow), "op3"])
def test_a_recorded_rise_is_followed_limb_by_limb(name):
    clip = read_clip(CMU / "140_03.amc")
    found = ClipRetargeter(load_robot(name)).retarget(clip, name="cmu", begin=1.0, end=6.5)
    assert found.motion.start_class == "right"
    assert math.degrees(found.mean_angle) < (2.0 if name == "human" else 15.0)


# A body in its rest pose, z up, x forward [m]; the right side is its mirror image.
MIDDLE = {"Spine1": (0.0, 0.0, 1.1), "Neck": (0.0, 0.0, 1.45)}
LEFT = {
    "LeftUpLeg": (0.0, 0.1, 0.9),
    "LeftLeg": (0.0, 0.1, 0.5),
    "LeftFoot": (0.0, 0.1, 0.1),
    "LeftToeBase": (0.15, 0.1, 0.02),
    "LeftArm": (0.0, 0.2, 1.4),
    "LeftForeArm": (0.0, 0.5, 1.4),
    "LeftHand": (0.0, 0.75, 1.4),
}
REST = MIDDLE | LEFT | {n.replace("Left", "Right"): (x, -y, z) for n, (x, y, z) in LEFT.items()}


def make(turn: Rotation | None = None, **moved: tuple[float, float, float]) -> Clip:
    """Make a clip of one frame: the rest pose, turned, with some joints elsewhere."""
    turn = turn or Rotation.identity()
    places = {name: np.array(place) for name, place in (REST | moved).items()}
    return Clip(
        file=Path("own.bvh"),
        period=0.01,
        joints={name: turn.apply(place)[None] for name, place in places.items()},
        rest={name: np.array(place) for name, place in REST.items()},
    )


@pytest.mark.parametrize("angles", [(40.0, 0.0, 0.0), (0.0, -80.0, 0.0), (10.0, 60.0, -30.0)])
def test_a_body_that_is_turned_is_turned_in_all_its_parts(angles):
    turn = Rotation.from_euler("zyx", angles, degrees=True)
    body, still = read_body(make(turn)), read_body(make())
    assert body.torso[0] == pytest.approx(turn.as_matrix())
    assert body.chest[0] == pytest.approx(turn.as_matrix())
    pose = body.limbs["right_leg"].pose(0, body.torso[0])
    own = still.limbs["right_leg"].pose(0, still.torso[0])
    assert pose.upper == pytest.approx(own.upper)
    assert pose.foot == pytest.approx(own.foot)


def test_a_body_without_hands_has_no_arms_and_one_without_toes_no_feet():
    clip = make()
    bare = {n: rows for n, rows in clip.joints.items() if "Hand" not in n and "Toe" not in n}
    body = read_body(replace(clip, joints=bare))
    assert set(body.limbs) == {"left_leg", "right_leg"}
    assert body.limbs["left_leg"].foot is None
