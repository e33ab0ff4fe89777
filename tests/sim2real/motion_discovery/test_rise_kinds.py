"""Kinds of learned rises: by the sides passed, and by the joint angles."""

import numpy as np

from humanoid_getup.motions.build import ATTITUDES
from humanoid_getup.simulation.world import World
from robots import Posture, quaternion
from robots.kinematics import place
from sim2real.motion_discovery.policy_rise import PolicyRise
from sim2real.motion_discovery.replay import Replay
from sim2real.motion_discovery.rise_kinds import group_rises, name_kind


def make_replay(world: World, sides: list[str], bend: float = 0.0) -> Replay:
    """Make a rise that lies on sides for 0.4 s each, its joints bent by so much [rad]."""
    robot = world.robot
    rows = []
    for side in sides:
        axis, angle = ATTITUDES[side]
        posture = Posture(
            position=np.array([0.0, 0.0, 0.3]),
            orientation=quaternion.from_axis_angle(np.array(axis), angle),
            joint_pos=robot.standing.joint_pos + bend,
        )
        rows += [place(robot, world.model, posture)] * round(0.4 / robot.control_period)
    qpos = np.array(rows)
    rise = PolicyRise(
        start_class=sides[0],  # type: ignore[arg-type]
        start=qpos[0],
        target=np.zeros((len(qpos), robot.n)),
        stand_time=len(qpos) * robot.control_period,
    )
    return Replay(
        rise=rise,
        target=rise.target,
        qpos=qpos,
        stood=np.ones(2, dtype=bool),
        stand_time=rise.stand_time,
        rms_torque=1.0,
    )


def test_a_kind_names_the_sides_passed_but_for_the_first(op3):
    world = World(op3)
    assert name_kind(world, make_replay(world, ["supine", "standing"])) == "learned"
    over = make_replay(world, ["supine", "left", "prone", "squat"])
    assert name_kind(world, over) == "learned, over left, prone"


def test_rises_over_other_sides_or_with_other_angles_are_grouped_apart(op3):
    world = World(op3)
    straight = [make_replay(world, ["supine", "squat"], bend) for bend in (0.0, 0.02, 1.0)]
    over = make_replay(world, ["supine", "prone", "squat"])
    groups = group_rises(world, [*straight, over])
    assert groups == [straight[:2], [straight[2]], [over]]
