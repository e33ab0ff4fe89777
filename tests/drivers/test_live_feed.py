import queue
import socket
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from recording_backend import still_state
from waiting import wait_until

from drivers import Command
from drivers.control_loop import Cycle, Timing
from drivers.errors import SetupError
from drivers.live_feed.feed import LiveFeed, list_feeds
from drivers.live_feed.follower import LiveFollower
from drivers.live_feed.messages import FeedError, LiveSample, find_feeds_folder
from drivers.safety_limits import ClipCounts
from robots import Robot

TIMEOUT = 60.0  # s; a wait ends with its event
ENOUGH = 1000  # cycles that fill the buffer of a connection


@pytest.fixture(autouse=True)
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))


@pytest.fixture
def samples() -> "queue.Queue[LiveSample]":
    return queue.Queue()


@pytest.fixture
def stops() -> "queue.Queue[str]":
    return queue.Queue()


@pytest.fixture
def feed(tiny: Robot, stops: "queue.Queue[str]") -> Iterator[LiveFeed]:
    with LiveFeed(tiny, stops.put) as served:
        yield served


def make_cycle(robot: Robot, time: float) -> Cycle:
    command = Command.position(robot, robot.standing.joint_pos)
    return Cycle(
        state=still_state(robot, time=time),
        asked=command,
        sent=command,
        clips=ClipCounts(*np.zeros((5, robot.n), dtype=int)),
        timing=Timing(late=0.0, read=0.001, step=0.002, write=0.001),
    )


def test_a_follower_receives_the_newest_cycle(
    tiny: Robot, feed: LiveFeed, samples: "queue.Queue[LiveSample]"
):
    assert list_feeds() == [feed.path]
    follower = LiveFollower(feed.path, samples.put)
    assert follower.hello.robot == tiny.name
    assert follower.hello.joint_names == tuple(tiny.joint_names)
    feed.show(make_cycle(tiny, 1.5))
    sample = samples.get(timeout=TIMEOUT)
    assert sample.time == 1.5
    assert sample.target == tiny.standing.joint_pos.tolist()
    assert sample.busy == pytest.approx(0.004)
    assert not sample.is_limp
    follower.close()


def test_every_follower_sees_the_same(
    tiny: Robot, feed: LiveFeed, samples: "queue.Queue[LiveSample]"
):
    followers = [LiveFollower(feed.path, samples.put) for _ in range(2)]
    feed.show(make_cycle(tiny, 2.0))
    assert samples.get(timeout=TIMEOUT) == samples.get(timeout=TIMEOUT)
    for follower in followers:
        follower.close()


def test_a_stop_reaches_the_program(
    feed: LiveFeed, samples: "queue.Queue[LiveSample]", stops: "queue.Queue[str]"
):
    follower = LiveFollower(feed.path, samples.put)
    follower.stop()
    assert stops.get(timeout=TIMEOUT) == "stopped from the live page"
    follower.close()
    assert stops.empty()


def test_a_follower_that_leaves_or_hangs_changes_nothing(
    tiny: Robot, feed: LiveFeed, samples: "queue.Queue[LiveSample]", stops: "queue.Queue[str]"
):
    hanging = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    hanging.connect(str(feed.path))
    LiveFollower(feed.path, samples.put).close()
    other = LiveFollower(feed.path, samples.put)
    feed.show(make_cycle(tiny, 3.0))
    assert samples.get(timeout=TIMEOUT).time == 3.0
    assert stops.empty()
    other.close()
    hanging.close()


def test_the_last_cycle_is_seen_even_if_the_program_ends_with_it(
    tiny: Robot, samples: "queue.Queue[LiveSample]", stops: "queue.Queue[str]"
):
    with LiveFeed(tiny, stops.put) as feed:
        follower = LiveFollower(feed.path, samples.put)
        feed.show(make_cycle(tiny, 7.0))
    assert samples.get(timeout=TIMEOUT).time == 7.0
    follower.close()


def go_on_once_closed(feed: LiveFeed, goes_on: threading.Event) -> None:
    wait_until(lambda: not feed.path.exists())
    goes_on.set()


def test_the_last_cycle_reaches_a_follower_that_lags_behind(
    tiny: Robot,
    samples: "queue.Queue[LiveSample]",
    stops: "queue.Queue[str]",
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.setattr("drivers.live_feed.feed.PERIOD", 1e-3)
    goes_on, received = threading.Event(), list[LiveSample]()

    def lag(sample: LiveSample) -> None:
        goes_on.wait()
        received.append(sample)

    with LiveFeed(tiny, stops.put) as feed:
        followers = [LiveFollower(feed.path, each) for each in (samples.put, lag)]
        for time in range(ENOUGH):
            feed.show(make_cycle(tiny, time))
            assert samples.get(timeout=TIMEOUT).time == time
        feed.show(make_cycle(tiny, ENOUGH))
        threading.Thread(target=go_on_once_closed, args=(feed, goes_on)).start()
    for follower in followers:
        follower.close()
    assert len(received) < ENOUGH
    assert received[-1].time == ENOUGH


def test_the_end_of_the_program_ends_the_feed(
    tiny: Robot, samples: "queue.Queue[LiveSample]", stops: "queue.Queue[str]"
):
    ended = threading.Event()
    with LiveFeed(tiny, stops.put) as feed:
        follower = LiveFollower(feed.path, samples.put, lambda _: ended.set())
    assert ended.wait(TIMEOUT)
    assert list_feeds() == []
    with pytest.raises(FeedError, match=r"live feed .*: No such file"):
        LiveFollower(feed.path, samples.put)
    follower.close()


def test_a_feed_that_a_killed_program_left_behind_is_removed():
    with subprocess.Popen([sys.executable, "-c", ""]) as ended:
        pass
    path = find_feeds_folder() / f"tiny-{ended.pid}.feed"
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as left:
        left.bind(str(path))
    assert path.exists()
    assert list_feeds() == []
    assert not path.exists()


@pytest.mark.parametrize("said", [b"\xff\xff\xff\xff", b"\x03\x00\x00\x00abc", b"\x01\x00"])
def test_what_is_no_feed_is_refused(said: bytes, samples: "queue.Queue[LiveSample]"):
    path = find_feeds_folder() / "other.feed"
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as server:
        server.bind(str(path))
        server.listen()

        def talk() -> None:
            connection, _ = server.accept()
            connection.sendall(said)
            connection.close()

        talker = threading.Thread(target=talk)
        talker.start()
        with pytest.raises(FeedError, match="live feed"):
            LiveFollower(path, samples.put)
        talker.join()


def test_a_folder_that_others_can_enter_is_refused():
    find_feeds_folder().chmod(0o755)
    with pytest.raises(FeedError, match="this user alone"):
        find_feeds_folder()


def test_the_folder_for_temporary_files_may_have_a_long_path(
    tiny: Robot,
    samples: "queue.Queue[LiveSample]",
    stops: "queue.Queue[str]",
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
):
    folder = tmp_path / ("x" * 200)
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    with LiveFeed(tiny, stops.put) as feed:
        assert list_feeds() == [feed.path]
        feed.show(make_cycle(tiny, 0.5))
        follower = LiveFollower(feed.path, samples.put)
        assert samples.get(timeout=TIMEOUT).time == 0.5
        follower.close()


def test_a_name_too_long_for_a_socket_is_refused_in_one_line(
    tiny: Robot, stops: "queue.Queue[str]"
):
    feed = LiveFeed(replace(tiny, name="x" * 100), stops.put)
    with pytest.raises(SetupError, match=r"live feed .*x-\d+\.feed: File name too long"):
        feed.__enter__()
