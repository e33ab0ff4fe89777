from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import mujoco.viewer
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from paths import TINY
from PIL import Image, ImageSequence
from recording_backend import still_state

from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.get_up.play import PlayRequest, play_motion
from humanoid_getup.commands.robot.watch import WatchRequest, watch
from humanoid_getup.commands.viewer import rest_measured
from humanoid_getup.experiments.falls import classify
from humanoid_getup.playback.estimation import SINKING
from humanoid_getup.reporting.video import save_video
from humanoid_getup.simulation.world import World
from robots import Robot, quaternion
from robots.kinematics import imu_in_torso, lowest_point

MOTION = "prone_push_up_gentle"


class FakeWindow:
    """MuJoCo's viewer without a display: keeps the positions of its last picture."""

    is_running, lock = staticmethod(lambda: True), staticmethod(nullcontext)

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, **_: bool) -> None:
        self.m, self.d, self.is_open, self.shown = model, data, True, np.zeros(0)

    def sync(self) -> None:
        self.shown = self.d.qpos.copy()

    def close(self) -> None:
        self.is_open = False


@pytest.mark.parametrize("backend", ["twin", "virtual"])
def test_a_viewer_shows_what_is_measured_until_the_end(
    backend: Any, tiny: Robot, monkeypatch: pytest.MonkeyPatch
):
    windows = list[FakeWindow]()

    def launch(*given: Any, **options: Any) -> FakeWindow:
        windows.append(FakeWindow(*given, **options))
        return windows[-1]

    monkeypatch.setattr("mujoco.viewer.launch_passive", launch)
    monkeypatch.setattr("humanoid_getup.commands.viewer.has_display", lambda: True)
    request = WatchRequest(robot=str(TINY), origin="prone", backend=backend, seconds=0.3, view=True)
    done = watch(request)
    assert done.last is not None
    (window,) = windows
    assert not window.is_open
    angles = [joint.angle_rad for joint in done.last.joints.values()]
    np.testing.assert_array_equal(window.shown[tiny.layout(window.m).qpos], angles)
    assert classify(window.shown[3:7]) == "prone"


@pytest.fixture(scope="module")
def tiny_world(tiny: Robot) -> World:
    return World(tiny)


@given(lean=st.floats(-3.0, 3.0), knee=st.floats(-1.0, 1.0))
def test_a_measured_robot_touches_the_ground_as_it_leans(
    tiny: Robot, tiny_world: World, lean: float, knee: float
):
    turned = quaternion.from_axis_angle(np.array([0.6, 0.8, 0.0]), lean)
    seen = quaternion.multiply(turned, imu_in_torso(tiny, tiny_world.model))
    state = still_state(tiny, joint_pos=np.array([knee, 0.0]), orientation=seen)
    qpos = rest_measured(tiny_world, state)
    np.testing.assert_allclose(qpos[3:7], turned, atol=1e-9)
    assert lowest_point(tiny_world.model, qpos) == pytest.approx(-SINKING, abs=1e-6)


def test_a_robot_without_an_imu_is_shown_upright(tiny: Robot):
    none = np.zeros(0)
    qpos = rest_measured(World(tiny), still_state(tiny, orientation=none, gyro=none))
    np.testing.assert_array_equal(qpos[3:7], [1.0, 0.0, 0.0, 0.0])


def test_what_cannot_be_shown_is_refused(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    for work, request in ((play_motion, PlayRequest(motion=MOTION)), (watch, WatchRequest())):
        with pytest.raises(BadInputError, match=r"--view: no window can be opened"):
            work(replace(request, view=True))
    for name in ("rise.avi", "rise", "rise.mp4.txt"):
        with pytest.raises(BadInputError, match=r"--video is .* expected a name ending in .mp4"):
            PlayRequest.accept(PlayRequest(motion=MOTION, video=Path(name)))


def test_mp4_without_its_package_is_refused_before_the_robot_moves(monkeypatch):
    monkeypatch.setattr("humanoid_getup.commands.get_up.session_hooks.find_spec", lambda _: None)
    with pytest.raises(BadInputError, match=r"requires package 'av'.*humanoid-getup\[studio\]"):
        play_motion(PlayRequest(motion=MOTION, video=Path("rise.mp4")))


@pytest.mark.slow
def test_a_video_shows_the_whole_run_at_its_own_speed(tmp_path: Path):
    finished = play_motion(PlayRequest(motion=MOTION, video=tmp_path / "rise.gif"))
    if finished.report.warnings and "no GL" in finished.report.warnings[-1]:
        pytest.skip(finished.report.warnings[-1])
    assert finished.files == (tmp_path / "rise.gif",)
    outcome, robot = finished.rise.outcome, finished.world.robot
    assert outcome is not None
    with Image.open(tmp_path / "rise.gif") as video:
        shown = sum(
            float(frame.info["duration"]) / 1000.0 for frame in ImageSequence.Iterator(video)
        )
    # GIF rounds to 10 ms.
    assert shown == pytest.approx(len(outcome.qpos) * robot.control_period, rel=0.1)
    av = pytest.importorskip("av")
    times, file = robot.control_period * np.arange(30), tmp_path / "part.mp4"
    save_video(robot, finished.world.model, times, outcome.qpos[:30], file)
    with av.open(str(file)) as video:
        assert len(list(video.decode(video=0))) == 8  # 30 a second of 0.232 s, the first at 0 s
