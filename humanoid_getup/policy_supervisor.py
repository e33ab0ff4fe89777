"""The policy's supervisor: runs a learned policy and gives up, limp, when servos suffer."""

from __future__ import annotations

from drivers import Command, State
from humanoid_getup.policy import OnnxPolicy
from humanoid_getup.servo_watch import ServoWatch
from humanoid_getup.supervision import Abort, AbortKind, Supervision


class PolicySupervisor:
    """Runs a policy and watches, each cycle, load and heat of the servos.

    Nobody knows how a policy will move, and one that falls may get up by itself, so neither
    tilt nor progress is held against it; its own time limit is.
    """

    def __init__(self, policy: OnnxPolicy, supervision: Supervision | None = None) -> None:
        """Prepare to run a policy; ``None`` for the default limits."""
        self._policy = policy
        self._servos = ServoWatch(policy.robot, supervision or Supervision())
        self.longest = policy.longest
        """Time after which it is done [s]."""
        self.aborted: Abort | None = None

    @property
    def warnings(self) -> list[str]:
        """Return what was odd but no reason to stop."""
        return self._servos.warnings

    @property
    def done(self) -> bool:
        """Tell whether the policy is done or was given up."""
        return self.aborted is not None or self._policy.done

    def reset(self, state: State) -> None:
        """Begin at the measured joint angles."""
        self._policy.reset(state)
        self._servos.reset(state)
        self._begin = state.time
        self.aborted = None

    def step(self, state: State) -> Command:
        """Let the policy move the robot, or release every joint."""
        command = self._policy.step(state)
        found = self._servos.judge(state)
        if found is None and self._policy.fault is not None:
            found = AbortKind.POLICY, self._policy.fault
        if found is None:
            return command
        self.aborted = Abort(*found, state.time - self._begin)
        return Command.limp(command.n)
