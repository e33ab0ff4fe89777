from contextlib import nullcontext
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import mujoco
import mujoco.viewer
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from paths import TINY
from PIL import Image
from recording_backend import still_state

from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.get_up.play import PlayRequest, play_motion
from humanoid_getup.commands.robot.watch import WatchRequest, watch
from humanoid_getup.commands.viewer import rest_measured
from humanoid_getup.experiments.falls import classify
from humanoid_getup.playback.estimation import SINKING
from humanoid_getup.reporting.film_strip import NoRendererError
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


@given(lean=st.floats(-3.0, 3.0), knee=st.floats(-1.0, 1.0))
def test_a_measured_robot_touches_the_ground_as_it_leans(tiny: Robot, lean: float, knee: float):
    turned = quaternion.from_axis_angle(np.array([0.6, 0.8, 0.0]), lean)
    mounting = imu_in_torso(tiny, World(tiny).model)
    state = still_state(
        tiny, joint_pos=np.array([knee, 0.0]), orientation=quaternion.multiply(turned, mounting)
    )
    world = World(tiny)
    qpos = rest_measured(world, state)
    np.testing.assert_allclose(qpos[3:7], turned, atol=1e-9)
    assert lowest_point(world.model, qpos) == pytest.approx(-SINKING, abs=1e-6)


def test_a_robot_without_an_imu_is_shown_upright(tiny: Robot):
    none = np.zeros(0)
    qpos = rest_measured(World(tiny), still_state(tiny, orientation=none, gyro=none))
    np.testing.assert_array_equal(qpos[3:7], [1.0, 0.0, 0.0, 0.0])


@pytest.mark.parametrize(
    ("work", "request_of"), [(play_motion, PlayRequest(motion=MOTION)), (watch, WatchRequest())]
)
def test_a_viewer_without_a_display_is_refused(
    work: Any, request_of: Any, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(BadInputError, match=r"--view: no window can be opened"):
        work(replace(request_of, view=True))


@pytest.mark.parametrize("name", ["rise.avi", "rise", "rise.mp4.txt"])
def test_a_video_of_another_format_is_refused(name: str):
    with pytest.raises(BadInputError, match=r"--video is .* expected a name ending in .mp4"):
        PlayRequest.accept(PlayRequest(motion=MOTION, video=Path(name)))


def test_mp4_without_its_package_is_refused_before_the_robot_moves(
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.setattr("humanoid_getup.commands.get_up.session_hooks.find_spec", lambda _: None)
    with pytest.raises(BadInputError, match=r"requires package 'av'.*humanoid-getup\[studio\]"):
        play_motion(PlayRequest(motion=MOTION, video=Path("rise.mp4")))


@pytest.mark.slow
def test_a_video_shows_the_whole_run_at_its_own_speed(tmp_path: Path):
    finished = play_motion(PlayRequest(motion=MOTION, video=tmp_path / "rise.gif"))
    if finished.report.warnings and "no GL" in finished.report.warnings[-1]:
        pytest.skip(finished.report.warnings[-1])
    assert finished.files == (tmp_path / "rise.gif",)
    outcome, period = finished.rise.outcome, finished.world.robot.control_period
    assert outcome is not None
    with Image.open(tmp_path / "rise.gif") as video:
        shown = sum(_pause(video, frame) for frame in range(video.n_frames)) / 1000.0
    assert shown == pytest.approx(len(outcome.qpos) * period, rel=0.1)  # GIF rounds to 10 ms
    if find_spec("av") is None:
        return
    import av

    world = finished.world
    times = [period * row for row in range(30)]
    try:
        save_video(
            world.robot, world.model, np.array(times), outcome.qpos[:30], tmp_path / "part.mp4"
        )
    except NoRendererError as error:
        pytest.skip(str(error))
    with av.open(str(tmp_path / "part.mp4")) as file:
        frames = list(file.decode(video=0))
    assert len(frames) == 8  # 30 a second of 0.232 s, the first one at 0 s


def _pause(video: Image.Image, frame: int) -> float:
    video.seek(frame)
    return float(video.info["duration"])
