"""The supervisor: runs a controller, and turns torque off when a monitor aborts the run."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from drivers import Command, Guidance, State
from humanoid_getup.motions.motion import STANDING, Motion
from humanoid_getup.playback.balance import Balance, make_balance
from humanoid_getup.playback.monitors import (
    Abort,
    MotionMonitor,
    PolicyMonitor,
    RunMonitor,
    ServoMonitor,
)
from humanoid_getup.playback.play import MotionPlayer, TimedController, hold_time
from humanoid_getup.policy.onnx_policy import OnnxPolicy
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.quaternion import Array


class StandHolder(MotionPlayer):
    """Sends the standing posture for a time, and then until it is released."""

    def __init__(
        self,
        robot: Robot,
        motion: Motion,
        *,
        least: float,
        is_released: Callable[[], bool],
        torque_limit: float | None = None,
        held: Array | None = None,
        balance: Balance | None = None,
    ) -> None:
        """Prepare to hold for at least a time [s].

        ``motion`` is that of `make_stand`; ``is_released`` is called every cycle; the others are
        those of the player.
        """
        super().__init__(
            robot, motion, hold=least, torque_limit=torque_limit, held=held, balance=balance
        )
        self._is_released = is_released
        self._least, self.longest = self.longest, math.inf

    @property
    def done(self) -> bool:
        """Return whether the time is over and the robot was released."""
        is_released = self._is_released()  # called every cycle
        return is_released and self._is_over(self._least)


def make_stand(robot: Robot) -> Motion:
    """Make the motion of one frame that is a robot's standing posture."""
    return make_still(robot, robot.standing.joint_pos)


def make_still(robot: Robot, target: Array) -> Motion:
    """Make the motion of one frame that sends targets [rad], (n,), expected to stand."""
    return Motion.through(
        [robot.standing],
        robot.control_period,
        name=STANDING,
        robot=robot.name,
        start_class=STANDING,
        strategy="standing still",
        joint_target=target[np.newaxis],
    )


class Supervisor:
    """A controller that turns torque off as soon as one of its monitors aborts the run."""

    def __init__(self, controller: TimedController, monitors: Sequence[RunMonitor]) -> None:
        self._controller, self._monitors = controller, monitors
        self.longest = controller.longest
        """Longest duration of the run, without the approach to its start [s]."""
        self.aborted: Abort | None = None

    @property
    def warnings(self) -> list[str]:
        """Return warnings about events that do not abort the run."""
        return [text for monitor in self._monitors for text in monitor.warnings]

    @property
    def guidance(self) -> Guidance | None:
        """Return the quantities that the controller follows besides its targets."""
        return getattr(self._controller, "guidance", None)

    @property
    def done(self) -> bool:
        """Return whether the controller is done or the run was aborted."""
        return self.aborted is not None or self._controller.done

    def reset(self, state: State) -> None:
        """Begin at the measured joint angles."""
        self._controller.reset(state)
        self._begin, self._target = state.time, state.joint_pos
        self.aborted = None
        for monitor in self._monitors:
            monitor.reset(state)

    def step(self, state: State) -> Command:
        """Return the controller's command, or torque off after an abort."""
        command = self._controller.step(state)
        findings = [monitor.check(state, self._target) for monitor in self._monitors]
        self._target = command.joint_pos
        found = next(filter(None, findings), None)
        self.aborted = found and Abort(*found, state.time - self._begin)
        return command if self.aborted is None else Command.limp(command.n)


def supervise_motion(
    world: World,
    motion: Motion,
    *,
    torque_limit: float | None = None,
    tracked: bool = True,
    held: Array | None = None,
    balanced: bool = True,
) -> Supervisor:
    """Make a supervised player of a motion that holds its end during judging.

    The torque limit [N·m] is that of every servo; ``tracked`` is False for a motion that was
    never rolled out; ``held`` are the targets that the servos follow already [rad], (n,);
    ``balanced`` is False to play a rise open loop.
    """
    player = MotionPlayer(
        world.robot,
        motion,
        hold=hold_time(motion),
        torque_limit=torque_limit,
        held=held,
        balance=make_balance(world, motion) if balanced and tracked else None,
    )
    tracking = MotionMonitor(world, motion, player, tracked=tracked)
    return Supervisor(player, [tracking, ServoMonitor(world.robot)])


def supervise_hold(
    world: World,
    posture: Motion,
    *,
    least: float,
    is_released: Callable[[], bool],
    torque_limit: float | None = None,
    held: Array | None = None,
    balanced: bool | None = True,
) -> Supervisor:
    """Make a supervised holder of a posture, such as the stand.

    ``least`` is how long it is held at least [s]; ``balanced`` is False to hold it without
    feedback to the ankles, and ``None`` for a robot without an IMU, of which the servos alone are
    monitored; the others are those of `StandHolder`.
    """
    holder = StandHolder(
        world.robot,
        posture,
        least=least,
        is_released=is_released,
        torque_limit=torque_limit,
        held=held,
        balance=Balance(world, posture) if balanced else None,
    )
    monitors: list[RunMonitor] = [ServoMonitor(world.robot)]
    if balanced is not None:
        monitors.insert(0, MotionMonitor(world, posture, holder))
    return Supervisor(holder, monitors)


def supervise_policy(policy: OnnxPolicy) -> Supervisor:
    """Make a supervised policy.

    The motion of a policy is not known beforehand, and it may get up again after a fall: only
    the servos are monitored, neither tilt nor progress; the policy's own time limit ends it.
    """
    return Supervisor(policy, [ServoMonitor(policy.robot), PolicyMonitor(policy)])
