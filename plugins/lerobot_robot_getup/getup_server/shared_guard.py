"""The safety guard of the robot, which publishes every measurement and command."""

from __future__ import annotations

import numpy as np

from drivers import Backend, Command, GuardLimits, State
from getup_server.mailbox import Mailbox
from humanoid_getup.jobs.get_up.session_hooks import CancellableGuard
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.simulation.world import World
from robots.kinematics import GravitySense, imu_in_torso
from robots.quaternion import Array


class TorsoSense:
    """The IMU's measurements in the frame of the torso."""

    def __init__(self, world: World) -> None:
        """Prepare for a robot, which may have no IMU."""
        has_imu = world.robot.imu_site is not None
        self._sense = GravitySense(imu_in_torso(world.robot, world.model)) if has_imu else None

    def find_gravity(self, state: State) -> Array:
        """Return the direction of gravity, (3,); (0,) without an IMU."""
        return self._sense(state.orientation) if self._sense and state.has_imu else np.zeros(0)

    def find_gyro(self, state: State) -> Array:
        """Return the angular velocity [rad/s], (3,); (0,) without an IMU."""
        if self._sense is None or not state.has_imu:
            return np.zeros(0)
        return self._sense.torso_from_imu @ state.gyro


class SharedGuard(CancellableGuard):
    """A guard that publishes what it measures and sends, and ends the work on request."""

    def __init__(
        self, backend: Backend, limits: GuardLimits, mailbox: Mailbox, world: World
    ) -> None:
        """Guard a backend; the mailbox tells when to end."""
        monitor = ProgressMonitor(cancel=mailbox.is_stopping)
        super().__init__(backend, limits, monitor.check)
        self._mailbox, self._torso = mailbox, TorsoSense(world)
        self._measured: State | None = None
        self._last = Command.limp(self.robot.n)

    @property
    def held(self) -> Array:
        """Return the last targets; the measured angles of joints without torque [rad], (n,)."""
        return self._mailbox.snapshot.targets

    def read(self) -> State:
        """Measure the robot, and publish it."""
        self._measured = super().read()
        self._publish()
        return self._measured

    def write(self, command: Command) -> Command:
        """Send a command within the limits, and publish it; return what was sent."""
        self._last = super().write(command)
        self._publish()
        return self._last

    def _publish(self) -> None:
        if self._measured is None:
            return
        state, sent = self._measured, self._last
        self._mailbox.measure(
            joint_pos=state.joint_pos,
            targets=np.where(sent.torque_limit > 0.0, sent.joint_pos, state.joint_pos),
            gravity_b=self._torso.find_gravity(state),
            gyro_b=self._torso.find_gyro(state),
        )
