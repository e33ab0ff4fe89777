"""Onlookers of a robot that moves: MuJoCo's own viewer, and the live feed."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from importlib.util import find_spec
from typing import Protocol

import mujoco

from drivers import Cycle, SafetyGuard, Twin
from drivers.control_loop import Pacer
from drivers.live_feed.feed import LiveFeed
from drivers.twin.simulation import Simulation
from humanoid_getup.jobs.backends import BackendChoice
from humanoid_getup.jobs.errors import BadInputError
from humanoid_getup.jobs.requests.onlookers import OnlookerOptions
from humanoid_getup.jobs.requests.rise import MP4, MoveOptions

VIEW_PERIOD = 1.0 / 60.0  # s between two pictures in the viewer


class Onlooker(Protocol):
    """Sees every control cycle, and does not delay that of a real robot."""

    def show(self, cycle: Cycle, /) -> None:
        """Show a cycle."""
        ...

    def note(self, phase: str, /) -> None:
        """Note the beginning of a phase."""
        ...


@contextmanager
def inviting(
    request: OnlookerOptions, choice: BackendChoice, guard: SafetyGuard
) -> Iterator[list[Onlooker]]:
    """Open the onlookers of a request while a robot moves.

    Raises:
        BadInputError: if there is no display for the viewer.
    """
    with ExitStack() as opened:
        onlookers: list[Onlooker] = []
        if request.live:
            onlookers.append(opened.enter_context(LiveFeed(guard.robot, guard.stop)))
        if request.view:
            viewer = _Viewer(_find_simulation(choice))
            opened.callback(viewer.close)
            onlookers.append(viewer)
        if onlookers and not choice.realtime:
            onlookers.append(_Brake(guard.period))
        yield onlookers


def begin_showing(onlookers: Sequence[Onlooker], phase: str) -> Callable[[Cycle], None]:
    """Note the beginning of a phase; return what shows its cycles to all onlookers."""
    for onlooker in onlookers:
        onlooker.note(phase)

    def show(cycle: Cycle) -> None:
        for onlooker in onlookers:
            onlooker.show(cycle)

    return show


class _Brake:
    """Holds a simulation that is looked at back to real time."""

    def __init__(self, period: float) -> None:
        self._pacer = Pacer(period)

    def show(self, _cycle: Cycle) -> None:
        self._pacer.wait()

    def note(self, _phase: str) -> None:
        pass


class _Viewer:
    """Shows the ground truth of a simulation in a window; a window that is closed stays closed."""

    def __init__(self, simulation: Simulation) -> None:
        check_display()
        from mujoco import viewer  # pyright: ignore[reportAttributeAccessIssue]  (no stub)

        self._truth = simulation.data
        self._data = mujoco.MjData(simulation.model)
        self._shown = 0.0
        self._window = viewer.launch_passive(
            simulation.model, self._data, show_left_ui=False, show_right_ui=False
        )

    def show(self, _cycle: Cycle) -> None:
        if time.perf_counter() - self._shown < VIEW_PERIOD or not self._window.is_running():
            return
        self._shown = time.perf_counter()
        with self._window.lock():
            self._data.qpos[:] = self._truth.qpos
            self._data.qvel[:] = self._truth.qvel
            mujoco.mj_forward(self._window.m, self._data)
        self._window.sync()

    def note(self, _phase: str) -> None:
        pass

    def close(self) -> None:
        self._window.close()


def check_video(request: MoveOptions) -> None:
    """Check that a video can be made, before the robot moves.

    Raises:
        BadInputError: if its package is missing.
    """
    if request.video is not None and request.video.suffix.lower() == MP4 and not find_spec("av"):
        raise BadInputError(
            f"--video {request.video} requires package 'av', expected .gif without it: "
            "pip install 'humanoid-getup[studio]'"
        )


def check_display() -> None:
    """Check that a window can be opened; MuJoCo's viewer would wait forever for one.

    Raises:
        BadInputError: if there is no display.
    """
    import glfw

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", glfw.GLFWError)
        if glfw.init():
            return
    raise BadInputError(
        "--view: no window can be opened, expected a display; --video FILE.mp4 needs none"
    )


def _find_simulation(choice: BackendChoice) -> Simulation:
    if isinstance(choice.backend, Twin):
        return choice.backend.simulation
    assert choice.simulation is not None  # a real robot is refused before
    return choice.simulation
