"""What a quintic controller plays of an exported motion is the motion that was judged."""

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from nonempty import nonempty
from recording_backend import still_state

from drivers import SafetyGuard, State, Twin
from humanoid_getup.commands.main import main
from humanoid_getup.commands.motions.export_motion import ExportMotionRequest, export_motion
from humanoid_getup.experiments.falls import settle_posture
from humanoid_getup.experiments.judging.judge import GroundTruthJudge
from humanoid_getup.experiments.judging.standing import HOLD
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import find_motion, load_database
from humanoid_getup.playback.play import MotionPlayer, play
from humanoid_getup.ros.joint_trajectory import JointTrajectory
from robots import Robot, load_robot, quaternion
from robots.kinematics import read_posture
from robots.quaternion import Array

APPROACH = 2.0  # s
BOUND = 0.012  # rad, at any time; 0.7 degrees
ROUNDING = 1e-6  # rad
MOTION = "supine_sit_up_gentle"


class QuinticController:
    """The spline between two points as a controller computes it: by the six ends of a segment."""

    def __init__(self, message: dict) -> None:
        points = message["points"]
        stamps = [point["time_from_start"] for point in points]
        self.time = np.array([s["sec"] + s["nanosec"] * 1e-9 for s in stamps])
        names = ("positions", "velocities", "accelerations")
        self.ends = np.array([[point[name] for name in names] for point in points])  # (T, 3, n)

    def sample(self, time: float) -> Array:
        """Return the targets at a time, (n,): before the first and after the last point, these."""
        if time >= self.time[-1]:
            return self.ends[-1, 0]
        k = int(np.searchsorted(self.time, time, side="right")) - 1
        if k < 0:
            return self.ends[0, 0]
        powers = np.arange(6)
        rows = []
        for at in (0.0, self.time[k + 1] - self.time[k]):
            for order in range(3):  # the derivatives of a polynomial's terms
                factor = [math.perm(p, order) for p in powers]
                rows.append(
                    [f * at ** max(p - order, 0) for p, f in zip(powers, factor, strict=True)]
                )
        coefficients = np.linalg.solve(rows, np.concatenate([self.ends[k], self.ends[k + 1]]))
        return (time - self.time[k]) ** powers @ coefficients


def export(robot: str, name: str, path: Path) -> dict:
    export_motion(ExportMotionRequest(robot=robot, motion=name, trajectory=path))
    return json.loads(path.read_text("utf-8"))


def sent_by_player(robot: Robot, motion: Motion) -> Array:
    """Return the targets that our player sends at each control period, (T, n)."""
    player = MotionPlayer(robot, motion, hold=0.0)
    state: Callable[[float], State] = lambda time: still_state(  # noqa: E731
        robot, time=time, joint_pos=motion.joint_target[0]
    )
    player.reset(state(0.0))
    times = np.arange(len(motion.time)) * robot.control_period
    return np.array([player.step(state(float(t))).joint_pos for t in times])


@pytest.mark.parametrize(
    ("robot", "name"),
    [("op3", "sit_and_lie_down"), ("wolfgang", "left_quick_1"), ("toddlerbot", "squat_to_stand")],
)
def test_the_controller_sends_at_the_control_period_what_the_player_sends(
    robot: str, name: str, tmp_path: Path
):
    body = load_robot(robot)
    motion = find_motion(body, name)
    controller = QuinticController(export(robot, name, tmp_path / "motion.json"))
    player = sent_by_player(body, motion)
    sent = [controller.sample(APPROACH + t) for t in np.arange(len(player)) * body.control_period]
    np.testing.assert_allclose(sent, player, atol=2 * ROUNDING)
    # A controller of another rate, whose cycles do not meet the points:
    times = np.random.default_rng(1).uniform(0.0, motion.duration, 600)
    between = np.array([controller.sample(APPROACH + t) for t in times])
    assert np.abs(between - motion.sample(times)).max() < BOUND


def test_every_stored_motion_begins_and_ends_at_rest_and_its_points_rise_in_time(op3: Robot):
    for motion in nonempty(load_database(op3).motions):
        trajectory = JointTrajectory.of(motion, op3, APPROACH)
        assert trajectory.time[0] == APPROACH
        assert np.diff(trajectory.time).min() > 0.0
        assert not trajectory.velocity[[0, -1]].any()
        assert not trajectory.acceleration[[0, -1]].any()
        assert np.array_equal(trajectory.position[-1], motion.joint_target[-1])


def make_motion(time: Array, targets: Array) -> Motion:
    """Make a motion of the tiny robot with targets (T, 2) at some times."""
    n = len(time)
    about = {"name": "odd", "robot": "tiny", "start_class": "standing", "strategy": "none"}
    still = {"position": np.zeros((n, 3)), "joint_pos": np.zeros((n, 2))}
    upright = np.tile(quaternion.IDENTITY, (n, 1))
    return Motion(time=time, joint_target=targets, orientation=upright, **about, **still)  # pyright: ignore[reportArgumentType]


def test_a_motion_of_other_times_is_sampled_and_held_to_its_end(tiny: Robot):
    targets = np.array([[0.0, 0.0], [0.03, 0.0], [0.21, 0.0]])
    motion = make_motion(np.array([1.0, 1.003, 1.021]), targets)
    trajectory = JointTrajectory.of(motion, tiny, 0.0)
    # By hand: 0.01 rad a ms, at 0, 8, 16 and, past the end at 21 ms, 24 ms.
    np.testing.assert_allclose(trajectory.position[:, 0], [0.0, 0.08, 0.16, 0.21])


def test_the_robot_that_a_quintic_controller_moves_ends_in_a_held_stand(
    op3: Robot, world, tmp_path: Path
):
    motion = find_motion(op3, MOTION)
    controller = QuinticController(export("op3", MOTION, tmp_path / "motion.json"))
    shift = 0.37 * op3.control_period  # its cycles never meet the points
    times = APPROACH + shift + np.arange(len(motion.time)) * op3.control_period
    played = replace(motion, joint_target=np.array([controller.sample(t) for t in times]))
    assert np.abs(played.joint_target - motion.joint_target).max() > ROUNDING
    twin = Twin(world)
    twin.place(read_posture(op3, world.model, settle_posture(world, motion.posture(0))))
    player = MotionPlayer(op3, played, hold=HOLD)
    report, outcome = play(player, SafetyGuard(twin), GroundTruthJudge(twin.simulation, None))
    assert outcome.stand.stood, report.reason


def test_yaml_and_json_of_a_goal_are_the_same(tmp_path: Path):
    yaml = pytest.importorskip("yaml")
    files = [tmp_path / f"motion{suffix}" for suffix in (".yaml", ".json")]
    for file in files:
        assert main(["motions", "export", MOTION, "--goal", "--trajectory", str(file)]) == 0
    written, other = yaml.safe_load(files[0].read_text()), json.loads(files[1].read_text())
    assert written == other
    assert written["trajectory"]["joint_names"] == list(load_robot("op3").joint_names)


def test_a_csv_file_has_the_targets_of_the_motion(op3: Robot, tmp_path: Path):
    file = tmp_path / "motion.csv"
    exported = export_motion(ExportMotionRequest(motion=MOTION, csv=file))
    header, *_ = file.read_text().splitlines()
    assert header.split(",") == ["time", *op3.joint_names]
    rows, motion = np.loadtxt(file, delimiter=",", skiprows=1), find_motion(op3, MOTION)
    np.testing.assert_array_equal(rows[:, 0], motion.time - motion.time[0])
    np.testing.assert_array_equal(rows[:, 1:], motion.joint_target)
    assert (exported.file, exported.points) == (file, len(rows))
