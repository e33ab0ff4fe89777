import queue
import tempfile
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from drivers.live_feed.feed import list_feeds
from drivers.live_feed.follower import LiveFollower
from drivers.live_feed.messages import LiveSample
from humanoid_getup.execution.result import AttemptStatus
from humanoid_getup.jobs.errors import BadInputError
from humanoid_getup.jobs.get_up.rise import play_motion
from humanoid_getup.jobs.requests.rise import PlayRequest
from humanoid_getup.progress.callback import Progress
from humanoid_getup.reporting.film_strip import NoRendererError
from humanoid_getup.reporting.video import save_video

TIMEOUT = 60.0  # s; a wait ends with its event
MOTION = "prone_push_up_gentle"


def test_a_live_rise_is_followed_and_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    samples, followers = queue.Queue[LiveSample](), list[LiveFollower]()

    def follow(progress: Progress) -> None:
        """Stop the robot by its feed as soon as it plays, and let it play on until it notices."""
        if progress.phase == "playing" and not followers:
            (feed,) = list_feeds()
            followers.append(LiveFollower(feed, samples.put))
            followers[0].stop()

    finished = play_motion(PlayRequest(motion=MOTION, live=True), report=follow)
    assert finished.rise.status is AttemptStatus.STOPPED
    assert "stopped from the live page" in finished.rise.reason
    assert list_feeds() == []
    (follower,) = followers
    assert follower.hello.robot == "op3"
    follower.close()


def test_a_viewer_without_a_display_is_refused(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(BadInputError, match=r"--view: no window can be opened, .*--video"):
        play_motion(PlayRequest(motion=MOTION, view=True))


@pytest.mark.parametrize("name", ["rise.avi", "rise", "rise.mp4.txt"])
def test_a_video_of_another_format_is_refused(name: str):
    with pytest.raises(BadInputError, match=r"--video is .* expected a name that ends with"):
        PlayRequest.accept(PlayRequest(motion=MOTION, video=Path(name)))


def test_mp4_without_its_package_is_refused_before_the_robot_moves(
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.setattr("humanoid_getup.jobs.get_up.onlookers.find_spec", lambda _: None)
    with pytest.raises(BadInputError, match=r"requires package 'av'.*humanoid-getup\[studio\]"):
        play_motion(PlayRequest(motion=MOTION, video=Path("rise.mp4")))


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
