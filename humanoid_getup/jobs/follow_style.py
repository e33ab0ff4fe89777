"""Rolls out rises on the twin in which a policy follows style curves, quickly and repeatedly."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from drivers import Cycle, DriverError, GuardLimits, SafetyGuard, State, Twin
from drivers.control_loop import Controller
from drivers.state import Command
from humanoid_getup.experiments.judging.judge import GroundTruthJudge
from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.experiments.judging.standing import HOLD_TIME
from humanoid_getup.jobs.errors import BadInputError, refusing
from humanoid_getup.jobs.policies import load_policy
from humanoid_getup.playback.estimation import check_start, settle
from humanoid_getup.playback.play import play
from humanoid_getup.playback.supervisor import Supervisor, supervise_policy
from humanoid_getup.policy.onnx_policy import OnnxPolicy
from humanoid_getup.progress.callback import Cancel, ProgressMonitor
from humanoid_getup.simulation.standing_places import check_standing_place
from humanoid_getup.simulation.world import World
from humanoid_getup.style.curves import StyleCurves, is_stand
from humanoid_getup.style.extraction import measure_features
from humanoid_getup.style.style import Style
from humanoid_getup.style.style_errors import FollowedStyle
from robots import Posture
from robots.kinematics import place
from robots.quaternion import Array

# A robot that has stood without a break for this time, and hardly moves at its end, stands.
STEADY_TIME = 1.0  # s
STEADY_SPEED = 0.1  # rad/s and m/s of every degree of freedom


@dataclass(frozen=True, kw_only=True, eq=False)
class StyledRollout:
    """A rise on the twin that followed style curves, sampled every control period."""

    outcome: Outcome
    """How it ended, with its record; a stand counts as held once it is steady."""
    time: Array
    """Times of the samples since the servos have torque [s], (T,)."""
    wanted: Array
    """Features that the policy was to have, (T, 3)."""
    measured: Array
    """Features that it measured, (T, 3), at the beginning of each policy step."""
    curves: StyleCurves
    """Curves that it followed first, mirrored if the robot lies on the other side."""
    followed: FollowedStyle
    """Errors from these curves."""
    reason: str
    """Why it ended, in one line."""

    @property
    def stand_time(self) -> float | None:
        """Return the time of the first moment of the stand [s]; None without one."""
        return float(self.outcome.stand_time) if self.outcome.stood else None


class StyledTwin:
    """A twin of a robot whose policy follows styles.

    Physics, servos, guard and policy are those of ``getup run POLICY --style FILE``, which has the
    same joint path. The policy and the settled start are kept between rollouts.
    """

    def __init__(self, world: World, policy: str) -> None:
        """Load a policy of the robot by name, or an .onnx file.

        Raises:
            BadInputError: if it cannot be used, or follows no style curves.
        """
        self.world = world
        self._policy = load_policy(world.robot, policy, None)
        if self._policy.contract.style is None:
            raise BadInputError(f"policy '{policy}' follows no style curves, expected one that does")
        self._start: Posture | None = None
        self._settled = Twin(world)

    def roll_out(self, start: Posture, style: Style, cancel: Cancel | None = None) -> StyledRollout:
        """Let the robot rise from a posture, and follow a style, until it stands or gives up.

        Raises:
            BadInputError: if it cannot start there.
            CancelledError: if ``cancel`` ended it.
        """
        monitor = ProgressMonitor(cancel=cancel)
        if start is not self._start:
            self._settle(start)
        monitor.check()
        twin = self._settled.copy()
        run = _Run(twin, self.world, self._policy.following(style), monitor)
        return run.roll_out(style)

    def _settle(self, start: Posture) -> None:
        """Place the robot, limp, and wait until it is still."""
        self._start = None
        _check(self.world, start)
        self._settled = Twin(self.world, start)
        try:
            with refusing():
                settle(_guard(self._settled))
        except DriverError as error:
            raise BadInputError(f"start posture: {error}") from error
        self._start = start


class _Run:
    """One rollout, and what is observed of it."""

    def __init__(
        self, twin: Twin, world: World, policy: OnnxPolicy, monitor: ProgressMonitor
    ) -> None:
        self._twin, self._policy, self._monitor = twin, policy, monitor
        self._judge = GroundTruthJudge(twin.simulation, None, world.scene)
        self._features: list[tuple[Array, Array]] = []
        self._upright_cycles = 0
        self.is_steady = False
        """Whether the robot has stood for a while, and hardly moves."""

    def roll_out(self, style: Style) -> StyledRollout:
        """Run the policy until the robot stands steadily, or to its end."""
        supervisor = supervise_policy(self._policy)
        controller = _UntilKnown(supervisor, lambda: self.is_steady)
        report, outcome = play(controller, _guard(self._twin), self._judge, on_cycle=self._observe)
        record = replace(outcome.record, settled=np.array(self.is_steady))
        features = np.array(self._features)  # (T, 2, 3)
        followed = self._policy.followed
        assert followed is not None  # it follows a style
        reason = str(supervisor.aborted) if supervisor.aborted else report.reason
        return StyledRollout(
            outcome=Outcome(record, outcome.robot),
            time=self._twin.period * np.arange(1, len(features) + 1),
            wanted=features[:, 0],
            measured=features[:, 1],
            curves=style.choose(features[0, 1]),
            followed=followed,
            reason=reason,
        )

    def _observe(self, cycle: Cycle) -> None:
        """Note the features of a cycle, and whether the robot stands steadily after it."""
        self._monitor.check()
        guidance = cycle.guidance
        assert guidance is not None
        self._features.append((guidance.wanted, guidance.measured))
        self._upright_cycles = self._upright_cycles + 1 if self._judge.is_upright else 0
        held = (self._upright_cycles - 1) * self._twin.period
        is_slow = held >= STEADY_TIME and np.abs(self._twin.data.qvel).max() < STEADY_SPEED
        self.is_steady = is_slow or held >= HOLD_TIME


class _UntilKnown(Controller):
    """A supervised policy that is done as soon as its outcome is known, too."""

    def __init__(self, supervisor: Supervisor, is_known: Callable[[], bool]) -> None:
        self._supervisor, self._is_known = supervisor, is_known
        self.longest = supervisor.longest

    @property
    def done(self) -> bool:
        return self._is_known() or self._supervisor.done

    @property
    def guidance(self) -> object:
        return self._supervisor.guidance

    def reset(self, state: State) -> None:
        self._supervisor.reset(state)

    def step(self, state: State) -> Command:
        return self._supervisor.step(state)


def _guard(twin: Twin) -> SafetyGuard:
    return SafetyGuard(twin, GuardLimits.of(twin.robot, None))


def _check(world: World, start: Posture) -> None:
    """Refuse a start from which no rise begins."""
    with refusing():
        check_start(world, start)
        check_standing_place(world, start.position)
    qpos = place(world.robot, world.model, start)
    features = measure_features(world.robot, world.model, qpos[None], world.scene.ground)
    if is_stand(features[0]):
        raise BadInputError("the robot stands, expected a start that lies: see the Pose tab")
