"""What keeping a stand needs: a robot behind its guard, what follows, and hooks to report."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, get_args

from drivers import Backend, Cycle, GuardLimits, SafetyGuard, Twin
from drivers.twin.simulation import Simulation
from humanoid_getup.execution.phase import PhaseChange
from humanoid_getup.experiments.judge import GroundTruthJudge, SensorJudge
from humanoid_getup.playback.play import Judge
from humanoid_getup.scenes.scene import Support
from humanoid_getup.simulation.world import World
from robots import FULL_TORQUE, TorqueLimit
from robots.torque_limit import check_torque_limit

Then = Literal["hold", "sit", "limp", "hand-over"]
"""What a robot does after its judged stand: it goes on standing until it is released, then sits
and lies down; sits and lies down at once; goes limp; or keeps its torque for another program."""


@dataclass(frozen=True, kw_only=True)
class StandSession:
    """A robot that stands, and what it does then."""

    guard: SafetyGuard
    world: World
    torque_limit: TorqueLimit = FULL_TORQUE
    then: Then = "sit"
    is_released: Callable[[], bool] = lambda: True
    """Whether a robot that is held may sit down; called every cycle."""
    preflight: bool = True
    """False: lie down without a preflight; never on hardware."""
    realtime: bool = False
    """Pace the cycles by the wall clock, for backends that do not pace themselves."""
    simulation: Simulation | None = None
    """Ground truth for the judges; None for sensors alone."""
    support: Support | None = None
    """Ground on which a simulated robot is; None for that of the world that was planned in."""
    place: Callable[[], None] | None = None
    """Places a simulated robot in its stand, once it is connected; None for a real one."""
    on_phase: Callable[[PhaseChange], None] = lambda _: None
    """Called with every phase."""
    on_cycle: Callable[[Cycle], None] | None = None
    """Called with every cycle of the runs, to record it."""

    def __post_init__(self) -> None:
        if self.then not in get_args(Then):
            expected = ", ".join(map(repr, get_args(Then)))
            raise ValueError(f"then is {self.then!r}, expected one of {expected}")

    @classmethod
    def on(
        cls, backend: Backend, world: World, torque_limit: TorqueLimit = FULL_TORQUE, **options: Any
    ) -> StandSession:
        """Keep the stand of a backend's robot; ``options`` are further fields of the session."""
        torque_limit = check_torque_limit(torque_limit, world.robot)
        guard, simulation = guard_robot(backend, torque_limit)
        if simulation is not None:
            options["simulation"] = simulation
        return cls(guard=guard, world=world, torque_limit=torque_limit, **options)

    @property
    def lies_down(self) -> bool:
        """Return whether the robot sits and lies down in the end."""
        return self.then in ("hold", "sit")

    def make_judge(self) -> Judge:
        """Make the judge of the next run."""
        limit = self.torque_limit.value
        if self.simulation is not None:
            return GroundTruthJudge(self.simulation, limit, self.world.scene, self.support)
        return SensorJudge(self.world, self.guard.period, limit)


def guard_robot(
    backend: Backend, torque_limit: TorqueLimit
) -> tuple[SafetyGuard, Simulation | None]:
    """Return a backend behind its guard, and the simulation of a twin.

    A backend without a guard is put behind one with the torque limit; a twin limits torque in
    the limit's mode.

    Raises:
        ValueError: if another backend limits torque in another mode.
    """
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
