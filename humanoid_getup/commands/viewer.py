"""MuJoCo's own viewer: what a robot measures while it moves or is read."""

from __future__ import annotations

import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from copy import copy
from typing import Any

import mujoco
import numpy as np

from drivers import Cycle, State
from drivers.control_loop import Pacer
from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.options import ViewOptions
from humanoid_getup.playback.estimation import SINKING
from humanoid_getup.simulation.clearance import Clearance
from humanoid_getup.simulation.world import World
from robots import Posture
from robots.kinematics import place, torso_orientation
from robots.quaternion import Array

PERIOD = 1.0 / 30.0  # s between two pictures
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


@contextmanager
def viewing(
    request: ViewOptions, world: World, *, realtime: bool
) -> Iterator[Callable[[Cycle], None]]:
    """Yield what shows each cycle in a window, if one is requested.

    The control loop only leaves its newest cycle; a backend that does not pace itself, not
    ``realtime``, is held back to the clock.
    """
    if not request.view:
        yield lambda _: None
        return
    if not has_display():
        raise BadInputError(
            "--view: no window can be opened, expected a display: use ssh -X, or leave it out"
        )
    window, pacer = _Window(world), None if realtime else Pacer(world.robot.control_period)

    def show(cycle: Cycle) -> None:
        window.newest = cycle.state
        if pacer:
            pacer.wait()

    try:
        yield show
    finally:
        window.close()


def has_display() -> bool:
    """Return whether a window can be opened; MuJoCo's viewer would wait forever for one."""
    import glfw

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", glfw.GLFWError)
        return bool(glfw.init())


class _Window:
    """Draws the newest state in a thread of its own; a window that is closed stays closed."""

    def __init__(self, world: World) -> None:
        from mujoco import viewer  # pyright: ignore[reportAttributeAccessIssue]  (no stub)

        self.newest: State | None = None
        self._world, self._ended = world, threading.Event()
        model = copy(world.model)  # the window may change it
        self._window: Any = viewer.launch_passive(
            model, mujoco.MjData(model), show_left_ui=False, show_right_ui=False
        )
        self._thread = threading.Thread(target=self._draw, name="viewer", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Draw the last state, and close."""
        self._ended.set()
        self._thread.join()
        self._window.close()

    def _draw(self) -> None:
        drawn, window, is_over = None, self._window, False
        while not is_over and window.is_running():
            is_over = self._ended.wait(PERIOD)
            if (state := self.newest) is not None and state is not drawn and state.is_valid:
                drawn, qpos = state, rest_measured(self._world, state)
                with window.lock():
                    window.d.qpos[:] = qpos
                    mujoco.mj_forward(window.m, window.d)
                window.sync()


def rest_measured(world: World, state: State) -> Array:
    """Compute MuJoCo positions, (nq,), of a robot as it is measured, at rest on what is under it.

    Its place and heading are not measured; without an IMU, its torso is upright.
    """
    robot = world.robot
    has_imu = state.has_imu and robot.imu_site is not None
    posture = Posture(
        position=np.array([0.0, 0.0, 1.0]),
        orientation=torso_orientation(robot, world.model, state.orientation)
        if has_imu
        else UPRIGHT,
        joint_pos=state.joint_pos,
    )
    return Clearance(world).rest(place(robot, world.model, posture), -SINKING)
