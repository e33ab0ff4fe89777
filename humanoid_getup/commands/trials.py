"""One trial of a command: a robot lies down or is found lying, and gets up, on record."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext

import numpy as np

from drivers import GuardLimits, SafetyGuard
from humanoid_getup.attempt import AttemptOptions, Plans
from humanoid_getup.attempt_result import PhaseChange
from humanoid_getup.commands.bodies import Body
from humanoid_getup.commands.flights import recording
from humanoid_getup.commands.inputs import TrialOptions
from humanoid_getup.lying import Fall
from humanoid_getup.rise import Rise, get_up
from humanoid_getup.stage import Stage
from humanoid_getup.start import check_start
from humanoid_getup.stop_key import StopKey
from humanoid_getup.watch import Watch

WHERE_IT_LAY = "where the robot lay"


def stop_key(body: Body, guard: SafetyGuard) -> StopKey | nullcontext[None]:
    """Let any key of the terminal stop a robot that lives at the speed of life."""
    return StopKey(guard.stop) if body.realtime else nullcontext()


def try_to_rise(
    stage: Stage,
    body: Body,
    plans: Plans,
    start: Fall | None,
    options: TrialOptions,
    rng: np.random.Generator,
    *,
    attempts: int,
    preflight: bool = True,
    tell: Callable[[str], None],
) -> Rise:
    """Get a robot up through the attempt manager, logging the flight.

    Args:
        stage: Robot and scene.
        body: Robot to move.
        plans: Finds motions or policies.
        start: Where to lay a simulated robot; ``None`` for where it lies.
        options: What the command was told.
        rng: Source of the plans' chance.
        attempts: How often to try.
        preflight: False: play without asking; never on hardware.
        tell: Hears what is going on.
    """
    simulation, limit = body.simulation, options.torque_limit
    guard = SafetyGuard(body.backend, GuardLimits.of(stage.robot, limit))
    if start is not None and body.place is not None:
        check_start(stage, start.posture)
        body.place(start.posture)
    how = AttemptOptions(
        max_attempts=attempts,
        torque_limit=limit,
        pwm_limited=body.has_servos,
        preflight=preflight,
        realtime=body.realtime,
    )
    about = {"seed": options.seed, "scene": options.scene, "backend": options.backend}
    with recording(options.out, stage.robot, about) as recorder, stop_key(body, guard):

        def hear(change: PhaseChange) -> None:
            tell(change.phase.value)
            recorder.note(change)

        return get_up(
            guard,
            stage,
            plans,
            rng,
            how,
            judge=simulation and (lambda: Watch(simulation, limit)),
            start_class=start and start.start_class,
            services=body.services,
            report=hear,
            on_cycle=recorder.log,
        )
