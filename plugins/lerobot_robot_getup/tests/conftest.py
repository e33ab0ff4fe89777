"""A twin that is run in this process, in steps, and how to wait for a process."""

import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

# Where the plugin is not installed, the tests that need no LeRobot run all the same.
sys.path.append(str(Path(__file__).parents[1]))

from getup_server.mailbox import Mailbox
from getup_server.messages import Setup, Snapshot
from getup_server.robot_request import RobotRequest
from getup_server.robot_runner import RobotRunner, RobotStoppedError
from getup_server.shared_guard import SharedGuard

from drivers import GuardLimits, Twin
from humanoid_getup.jobs.backends import BackendChoice
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.cache.plan_cache import FOLDER_VARIABLE
from humanoid_getup.strategies.plan import Strategy
from robots import Posture, Robot, load_robot

LONGEST_WAIT = 120.0  # s


@pytest.fixture(scope="session")
def op3() -> Robot:
    return load_robot("op3")


@pytest.fixture(scope="session")
def world(op3: Robot) -> World:
    return World(op3)


@pytest.fixture(autouse=True)
def folders(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """Keep tests away from the user's plan cache and LeRobot folder."""
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path_factory.mktemp("plans")))
    monkeypatch.setenv("HF_LEROBOT_HOME", str(tmp_path_factory.mktemp("lerobot")))
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")


@dataclass
class RunningRobot:
    """A twin in a thread of this process, as fast as the computer can."""

    mailbox: Mailbox
    twin: Twin
    thread: threading.Thread
    failures: list[str]

    def wait_until(self, holds: Callable[[Snapshot], bool], *, silently: bool = False) -> Snapshot:
        """Wait until something holds for what is known; fail if it never does.

        It is observed as by LeRobot, unless ``silently``.
        """
        look = (lambda: self.mailbox.snapshot) if silently else self.mailbox.observe
        return wait_until(look, holds)


def wait_until(
    look: Callable[[], Snapshot], holds: Callable[[Snapshot], bool], longest: float = LONGEST_WAIT
) -> Snapshot:
    """Look again and again until something holds; fail if it never does."""
    end = time.monotonic() + longest
    while not holds(known := look()):
        assert time.monotonic() < end, f"never within {longest:g} s: {known}"
        time.sleep(0.005)
    return known


@pytest.fixture
def run_twin(world: World) -> Iterator[Callable[..., RunningRobot]]:
    """Make what runs a twin; it is asked to end after the test."""
    running: list[RunningRobot] = []

    def run(
        start: Posture | None = None, strategy: Strategy | None = None, **changes
    ) -> RunningRobot:
        nothing = np.zeros(world.robot.n)
        mailbox = Mailbox(
            Snapshot(joint_pos=nothing, targets=nothing, gravity_b=nothing[:0], gyro_b=nothing[:0])
        )
        settings = {
            "request": RobotRequest(attempts=1),
            "rises": strategy is not None,
            "realtime": False,
            "max_speed": np.inf,
            "approach_speed": 1.0,
            "fallen_tilt": np.radians(45.0),
        }
        setup = Setup(**(settings | changes))
        twin = Twin(world)
        choice = BackendChoice(backend=twin, realtime=False, place=twin.place)
        guard = SharedGuard(twin, GuardLimits.of(world.robot), mailbox, world)
        begin = start or world.robot.standing
        runner = RobotRunner(choice, guard, mailbox, setup, world, strategy, begin)
        failures: list[str] = []

        def work() -> None:
            try:
                runner.run()
                mailbox.end("asked to end")
            except RobotStoppedError as error:
                failures.append(str(error))
                mailbox.end(str(error))

        thread = threading.Thread(target=work)
        running.append(RunningRobot(mailbox, twin, thread, failures))
        thread.start()
        return running[-1]

    yield run
    for each in running:
        each.mailbox.stop()
        each.thread.join(LONGEST_WAIT)
        assert not each.thread.is_alive()
