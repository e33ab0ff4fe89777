"""A session: one robot behind its guard, with its options, phases and callbacks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from typing import Literal, get_args

from drivers import Backend, Controller, Cycle, GuardLimits, SafetyGuard, Twin
from drivers.twin.simulation import Simulation
from humanoid_getup.execution.recovery import Cooling, RebootsServos
from humanoid_getup.experiments.judging.judge import GroundTruthJudge, JointJudge, SensorJudge
from humanoid_getup.playback.play import AnyJudge
from humanoid_getup.scenes.scene import Support
from humanoid_getup.simulation.placement import Placement
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import Plan
from robots import FULL_TORQUE, Posture, TorqueLimit
from robots.torque_limit import check_torque_limit


class Phase(Enum):
    """What an attempt is doing."""

    SETTLING = "waiting until the robot is still"
    PLANNING = "planning"
    PREFLIGHT = "preflight"
    PLAYING = "playing"
    HOLDING = "holding the stand"
    FOLLOWING = "following its pilot"
    LYING_DOWN = "sitting and lying down"
    RECOVERING = "recovering"
    ENDED = "ended"


@dataclass(frozen=True)
class PhaseChange:
    """The start of a phase."""

    phase: Phase
    attempt: int
    """From 1."""
    detail: str


Then = Literal["hold", "sit", "limp", "hand-over"]
"""What a robot does after its judged stand: it keeps standing until it is released, then sits
and lies down; sits and lies down at once; goes limp; or keeps its torque for another program."""


@dataclass(frozen=True, kw_only=True)
class SessionOptions:
    """Options of a session; the defaults suit a robot that lies on flat ground."""

    then: Then | None = None
    """What follows a judged stand; None for limp in simulation, and for hold on servos."""
    pilot: Controller | None = None
    """Moves the robot after the judged stand of a rise, without a gap and unsupervised, until it is
    done; what ``then`` says follows, but for the hold. None: the stand is kept."""
    is_released: Callable[[], bool] = lambda: True
    """Returns whether the hold of a stand ends; called every cycle."""
    balance: bool = True
    """Whether the ankles balance the robot while it rises by a motion, and while it stands."""
    preflight: bool = True
    """False: move without a preflight; never on hardware."""
    realtime: bool | None = None
    """Pace the cycles by the wall clock, for backends that do not pace themselves; None for all
    but simulated robots."""
    settle: bool = True
    """False for a simulated robot that was placed at rest: it is measured at once."""
    start_class: str | None = None
    """Side on which the robot lies, where that is known; None: as first measured."""
    assumed_start: Posture | None = None
    """Where a robot without an IMU is taken to lie: it is moved open loop, and no stand is
    claimed; None: its orientation is measured."""
    cooling: Cooling = field(default_factory=Cooling)
    """How long it rests after a failed attempt."""
    simulation: Simulation | None = None
    """Ground truth for the judges; None for that of a twin, and else for sensors alone."""
    support: Support | None = None
    """Ground under a simulated robot; None for that of the world of the plan."""
    locate: Callable[[], Placement] | None = None
    """Tells where in its scene the robot lies; a rise needs it unless the scene is flat."""
    moved: Callable[[Plan], None] = lambda _: None
    """Called after a move to a place with room, for a `locate` that does not measure."""
    place: Callable[[], None] | None = None
    """Places a simulated robot in its stand, once it is connected; None for a real one."""
    on_phase: Callable[[PhaseChange], None] = lambda _: None
    """Called with every phase."""
    on_cycle: Callable[[Cycle], None] | None = None
    """Called with every cycle of the runs, to record it."""

    def __post_init__(self) -> None:
        if self.then is not None and self.then not in get_args(Then):
            expected = ", ".join(map(repr, get_args(Then)))
            raise ValueError(f"then is {self.then!r}, expected one of {expected}")


@dataclass(frozen=True, kw_only=True)
class Session(SessionOptions):
    """A robot behind its guard, connected for each phase, with torque off after each.

    Only a robot that is handed over keeps its torque.
    """

    guard: SafetyGuard
    world: World
    torque_limit: TorqueLimit = FULL_TORQUE
    """Torque limit of plans, preflight and judges."""
    then: Then = "limp"
    realtime: bool = False

    @classmethod
    def on(
        cls,
        backend: Backend,
        world: World,
        torque_limit: TorqueLimit = FULL_TORQUE,
        options: SessionOptions | None = None,
    ) -> Session:
        """Begin a session with the robot of a backend, in a world.

        A backend without a guard is put behind one with the torque limit. A twin limits torque in
        the limit's mode, and is judged by ground truth.
        """
        chosen = vars(options or SessionOptions()).copy()
        torque_limit = check_torque_limit(torque_limit, world.robot)
        guard, simulation = _guard_robot(backend, torque_limit)
        chosen["simulation"] = simulation = simulation or chosen["simulation"]
        if simulation is not None and not world.scene.is_flat:
            truth = simulation.truth
            chosen["locate"] = chosen["locate"] or (lambda: Placement.of(truth.posture))
        is_simulated = simulation is not None
        chosen["then"] = chosen["then"] or ("limp" if is_simulated else "hold")
        if chosen["realtime"] is None:
            chosen["realtime"] = not is_simulated
        return cls(guard=guard, world=world, torque_limit=torque_limit, **chosen)

    @property
    def services(self) -> RebootsServos | None:
        """Return the backend if it can reboot servos, else ``None``."""
        backend = self.guard.backend
        return backend if isinstance(backend, RebootsServos) else None

    @property
    def has_imu(self) -> bool:
        """Return whether the robot measures its orientation."""
        return self.assumed_start is None

    @property
    def lies_down(self) -> bool:
        """Return whether the robot sits and lies down in the end."""
        return self.then in ("hold", "sit") and self.has_imu

    def make_judge(self) -> AnyJudge:
        """Make the judge of the next run; without an IMU, one that claims no stand."""
        limit = self.torque_limit.value
        if not self.has_imu:
            return JointJudge(self.world.robot, limit)
        if self.simulation is not None:
            return GroundTruthJudge(self.simulation, limit, self.world.scene, self.support)
        return SensorJudge(self.world, self.guard.period, limit)


def _guard_robot(
    backend: Backend, torque_limit: TorqueLimit
) -> tuple[SafetyGuard, Simulation | None]:
    """Return a backend behind its guard, and the simulation of a twin."""
    guard = backend
    if not isinstance(guard, SafetyGuard):
        guard = SafetyGuard(backend, GuardLimits.of(backend.robot, torque_limit.value))
    body, mode = guard.backend, torque_limit.on(backend.robot).mode
    if isinstance(body, Twin):
        body.limit_by = mode
        return guard, body.simulation
    if body.limit_by != mode:
        raise ValueError(
            f"the backend limits torque by '{body.limit_by}', expected '{mode}' as "
            "the strategy: build both with one mode"
        )
    return guard, None


class DeadReckoning:
    """Estimates the place of a robot: a given one at first, then the planned ends of its moves.

    Attitude and joint angles are measured; an error in place or heading is not noticed.
    """

    def __init__(self, placement: Placement) -> None:
        self._placement = placement

    def locate(self) -> Placement:
        """Return where the robot lies."""
        return self._placement

    def move(self, plan: Plan) -> None:
        """Advance to the planned end of a move."""
        if plan.motion is not None:
            self._placement = Placement.of(plan.motion.posture(-1))
