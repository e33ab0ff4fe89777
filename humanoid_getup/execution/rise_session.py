"""What getting up needs: a robot behind its guard, a strategy, options, and hooks to report."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from drivers import Backend, Cycle, SafetyGuard
from drivers.twin.simulation import Simulation
from humanoid_getup.execution.phase import PhaseChange
from humanoid_getup.execution.recovery import Cooling, RebootsServos
from humanoid_getup.execution.stand_session import StandSession, Then, guard_robot
from humanoid_getup.playback.play import Judge
from humanoid_getup.scenes.scene import Support
from humanoid_getup.simulation.placement import Placement
from humanoid_getup.strategies.plan import RisePlan, Strategy


@dataclass(frozen=True, kw_only=True)
class RiseSession:
    """A robot that is to get up, how, and how often it may try."""

    guard: SafetyGuard
    """Robot; it is connected for each phase, and torque is off after each but a hand-over."""
    strategy: Strategy
    """Makes the plans; its world and torque limit are those of preflight and judges, too."""
    max_attempts: int = 3
    balance: bool = True
    """Whether the ankles balance the robot while it rises by a motion, and while it stands."""
    start_class: str | None = None
    """Side on which the robot lies, where that is known; None: as first measured."""
    settle: bool = True
    """False for a simulated robot that was placed at rest: it is measured at once."""
    preflight: bool = True
    """False: play without a preflight; never on hardware."""
    realtime: bool = False
    """Pace the cycles by the wall clock, for backends that do not pace themselves."""
    cooling: Cooling = field(default_factory=Cooling)
    then: Then = "limp"
    """What follows a judged stand."""
    is_released: Callable[[], bool] = lambda: True
    """Whether a robot that is held after its stand may sit down; called every cycle."""
    simulation: Simulation | None = None
    """Ground truth for the judges; None for sensors alone."""
    support: Support | None = None
    """Ground on which a simulated robot is; None for that of the world that was planned in."""
    locate: Callable[[], Placement] | None = None
    """Tells where in its scene the robot lies; needed unless the scene is flat."""
    moved: Callable[[RisePlan], None] = lambda _: None
    """Called after a move to where there is room, for a `locate` that cannot look."""
    services: RebootsServos | None = None
    """Reboots servos; None where the backend cannot."""
    on_phase: Callable[[PhaseChange], None] = lambda _: None
    """Called with every phase."""
    on_cycle: Callable[[Cycle], None] | None = None
    """Called with every cycle of the runs, to record it."""

    def __post_init__(self) -> None:
        if self.max_attempts < 1:
            raise ValueError(f"max_attempts is {self.max_attempts}, expected 1 or more")
        scene = self.strategy.world.scene
        if self.locate is None and not scene.is_flat:
            raise ValueError(
                f"scene '{scene.name}' is not the same everywhere, expected `locate`, which tells "
                "where in it the robot lies"
            )

    @classmethod
    def on(cls, backend: Backend, strategy: Strategy, **options: Any) -> RiseSession:
        """Let the robot of a backend get up; ``options`` are further fields of the session.

        A backend without a guard is put behind one with the strategy's torque limit. A twin
        limits torque in the mode of the strategy and is judged by ground truth; other backends
        reboot servos if they can.

        Raises:
            ValueError: if the backend limits torque in another mode.
        """
        guard, simulation = guard_robot(backend, strategy.torque_limit)
        if simulation is not None:
            options["simulation"] = simulation
        body = options.get("simulation")
        if body is not None and not strategy.world.scene.is_flat:
            options.setdefault("locate", lambda: Placement.of(body.truth.posture))
        if simulation is None and isinstance(guard.backend, RebootsServos):
            options["services"] = guard.backend
        return cls(guard=guard, strategy=strategy, **options)

    @property
    def stand(self) -> StandSession:
        """Return the session of what follows the stand."""
        return StandSession(
            guard=self.guard,
            world=self.strategy.world,
            torque_limit=self.strategy.torque_limit,
            then=self.then,
            is_released=self.is_released,
            preflight=self.preflight,
            realtime=self.realtime,
            simulation=self.simulation,
            support=self.support,
            on_phase=self.on_phase,
            on_cycle=self.on_cycle,
        )

    def make_judge(self) -> Judge:
        """Make the judge of the next run."""
        return self.stand.make_judge()
