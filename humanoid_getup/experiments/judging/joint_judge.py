"""The judge of a robot without an IMU, by the measurements of its joints."""

from __future__ import annotations

from drivers import Cycle, State
from humanoid_getup.experiments.judging.joint_figures import JointFigures
from robots import Robot


class JointJudge:
    """Judges a run without an orientation: figures of the joints, but no stand."""

    def __init__(self, robot: Robot, torque_limit: float | None) -> None:
        """Judge under a torque limit [N·m]."""
        self._robot, self._limit = robot, torque_limit
        self._states: list[State] = []

    def __call__(self, cycle: Cycle) -> None:
        """Record a measurement."""
        self._states.append(cycle.state)

    def end(self) -> None:
        """Return that it is not known whether the run ended in a stand."""

    def conclude(self) -> JointFigures:
        """Return the figures of the run."""
        return JointFigures.of(self._robot, self._limit, self._states)
