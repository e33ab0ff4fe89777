"""Rolls out rises on the twin in which a policy follows style curves, quickly and repeatedly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drivers import Cycle, DriverError, GuardLimits, SafetyGuard, Twin
from humanoid_getup.commands.errors import BadInputError, refusing
from humanoid_getup.commands.policies import load_policy
from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.playback.estimation import check_start, settle
from humanoid_getup.playback.simulated_play import play_in_simulation
from humanoid_getup.playback.supervisor import supervise_policy
from humanoid_getup.policy.onnx_policy import OnnxPolicy
from humanoid_getup.progress.callback import Cancel, ProgressMonitor
from humanoid_getup.simulation.placement import check_standing_place
from humanoid_getup.simulation.world import World
from humanoid_getup.style.curves import StyleCurves, is_stand, measure_features
from humanoid_getup.style.followed_style import FollowedStyle
from humanoid_getup.style.style import Style
from robots import Posture
from robots.kinematics import place
from robots.quaternion import Array

STANDS = "the start stands, expected a robot that lies"


@dataclass(frozen=True, kw_only=True, eq=False)
class RolloutRequest:
    """Roll out a rise."""

    policy: str
    """Name of a policy of the robot that follows style curves, or an .onnx file."""
    start: Posture
    """Posture from which it rises, once it has settled there."""
    style: Style


@dataclass(frozen=True, kw_only=True, eq=False)
class StyledRollout:
    """A rise on the twin that followed style curves, sampled every control period."""

    request: RolloutRequest
    outcome: Outcome
    """How it ended, with its record; a stand counts as held once it is steady."""
    begin: Array
    """MuJoCo positions at its beginning, once the robot has settled, (nq,)."""
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
    def joint_torque(self) -> Array:
        """Return the torques at the joints [N·m], (T, n)."""
        return self.outcome.robot.transmission.torque_at_joint(self.outcome.record.torque)

    @property
    def stand_time(self) -> float | None:
        """Return the time of the first moment of the stand [s]; None without one."""
        return float(self.outcome.stand_time) if self.outcome.stood else None


class StyledTwin:
    """A twin in a world, whose policies follow styles.

    Physics, servos, guard and policy are those of ``getup run POLICY --style FILE``, which has the
    same joint path. Policy and settled start are kept from one rollout to the next.
    """

    def __init__(self, world: World) -> None:
        self.world = world
        self._policies: dict[str, OnnxPolicy] = {}
        self._settled: tuple[Posture, Twin] | None = None

    def roll_out(self, request: RolloutRequest, cancel: Cancel | None = None) -> StyledRollout:
        """Let the robot rise, and follow a style, until it is known to stand or gives up."""
        monitor = ProgressMonitor(cancel=cancel)
        slope = self.world.scene.slope
        policy = self._load(request.policy).following(request.style, slope, request.start)
        twin = self._settle(request.start).copy()
        monitor.check()
        supervisor, begin = supervise_policy(policy), twin.truth.qpos
        seen = list[tuple[Array, Array]]()

        def observe(cycle: Cycle) -> None:
            monitor.check()
            assert cycle.guidance is not None  # it follows a style
            seen.append((cycle.guidance.wanted, cycle.guidance.measured))

        report, outcome = play_in_simulation(
            supervisor,
            _guard(twin),
            twin.simulation,
            self.world.scene,
            on_cycle=observe,
            stop_early=True,
        )
        # A policy that fails ends with a limp command, of which there is no sample.
        features = np.array(seen[: len(outcome.qpos)])  # (T, 2, 3)
        if not len(features):
            raise BadInputError(f"the policy does not move the robot: {supervisor.aborted}")
        assert policy.followed is not None
        return StyledRollout(
            request=request,
            outcome=outcome,
            begin=begin,
            time=twin.period * np.arange(1.0, len(features) + 1.0, dtype=float),
            wanted=features[:, 0],
            measured=features[:, 1],
            curves=request.style.choose(features[0, 1]),
            followed=policy.followed,
            reason=str(supervisor.aborted) if supervisor.aborted else report.reason,
        )

    def _load(self, name: str) -> OnnxPolicy:
        if name not in self._policies:
            policy = load_policy(self.world.robot, name, None)
            if policy.contract.style is None:
                raise BadInputError(
                    f"policy '{name}' follows no style curves, expected one that does"
                )
            self._policies[name] = policy
        return self._policies[name]

    def _settle(self, start: Posture) -> Twin:
        """Place the robot, limp, and wait until it is still."""
        if self._settled is None or self._settled[0] is not start:
            _check(self.world, start)
            twin = Twin(self.world, start)
            try:
                with refusing():
                    settle(_guard(twin))
            except DriverError as error:
                raise BadInputError(f"start posture: {error}") from error
            self._settled = start, twin
        return self._settled[1]


def _guard(twin: Twin) -> SafetyGuard:
    return SafetyGuard(twin, GuardLimits.of(twin.robot, None))


def measure_start(world: World, start: Posture) -> Array:
    """Measure the style features of a start, (3,)."""
    qpos = place(world.robot, world.model, start)
    return measure_features(world.robot, world.model, qpos[None], world.scene.ground)[0]


def _check(world: World, start: Posture) -> None:
    """Refuse a start from which no rise begins."""
    if is_stand(measure_start(world, start)):
        raise BadInputError(STANDS)
    with refusing():
        check_start(world, start)
        check_standing_place(world, start.position)
