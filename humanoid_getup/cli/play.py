"""`getup play MOTION`: play a rising motion as it is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from tyro.conf import Positional

from humanoid_getup.cli.errors import refusing
from humanoid_getup.cli.options import (
    MotionName,
    Origin,
    RunOptions,
    find_start,
    find_start_faults,
)
from humanoid_getup.cli.output import phase

if TYPE_CHECKING:
    from drivers import SafetyGuard
    from drivers.twin.simulation import Simulation
    from humanoid_getup.cli.backends import BackendChoice
    from humanoid_getup.execution.get_up import Rise
    from humanoid_getup.motions.motion import Motion
    from humanoid_getup.simulation.falls import Fall
    from humanoid_getup.simulation.world import World
    from robots import Posture, Robot

OWN_START = "the motion's own"


@dataclass(frozen=True, kw_only=True)
class Play(RunOptions):
    """Play a rising motion and judge how it ends."""

    motion: Positional[MotionName]
    origin: Origin = None

    def find_faults(self) -> list[str]:
        """Report all that is wrong beyond the type and range of single values."""
        faults = super().find_faults()
        return faults + find_start_faults(self.origin, is_real=self.is_real, needs_one=False)

    def run(self) -> int:
        """Lie down, or find the robot lying, and play."""
        with phase("loading"):
            from drivers import GuardLimits, SafetyGuard
            from humanoid_getup.cli.results import hand_over
            from humanoid_getup.cli.session import WHERE_IT_LAY, stop_key

            world = self.load_stage()
            motion = find_motion(world.robot, self.motion)
        with phase("opening the backend") as tell, self.open_body(world) as body:
            tell("playing")
            guard = SafetyGuard(body.backend, GuardLimits.of(world.robot, self.torque_limit))
            with stop_key(body, guard):
                if body.simulation is None or body.place is None:
                    rise = self._play_where_it_lies(world, motion, body, guard)
                else:
                    start = self._lie_down(world, motion, guard, body.place)
                    rise = self._play(motion, body, body.simulation, guard, start)
            tell("drawing")
            extra = {"motion": motion.name, "strategy": motion.strategy}
            origin = WHERE_IT_LAY if self.is_real else self.origin or OWN_START
            return hand_over(rise, world, self, origin, extra)

    def _lie_down(
        self,
        world: World,
        motion: Motion,
        guard: SafetyGuard,
        place: Callable[[Posture], None],
    ) -> Fall:
        import numpy as np

        from humanoid_getup.execution.estimation import settle
        from humanoid_getup.simulation.falls import Fall, settle_posture
        from robots.kinematics import read_posture

        if self.origin is None:
            at_rest = settle_posture(world, motion.posture(0))
            posture = read_posture(world.robot, world.model, at_rest)
            place(posture)
            return Fall(posture=posture, start_class=motion.start_class)
        fall = find_start(world, self.origin, np.random.default_rng(self.seed))
        place(fall.posture)
        settle(guard)
        return fall

    def _play(
        self,
        motion: Motion,
        body: BackendChoice,
        simulation: Simulation,
        guard: SafetyGuard,
        start: Fall,
    ) -> Rise:
        from humanoid_getup.cli.session import recording
        from humanoid_getup.evaluation.judge import GroundTruthJudge
        from humanoid_getup.execution.get_up import Rise, play
        from humanoid_getup.strategies.stored_motion import as_it_is

        limit = self.torque_limit
        known = start.posture if self.origin is None else None
        with recording(self.out, guard.robot, self._about(motion), known) as recorder:
            report, outcome = play(
                guard,
                GroundTruthJudge(simulation, limit),
                motion,
                limit,
                realtime=body.realtime,
                on_cycle=recorder.log,
            )
        return Rise(
            robot=guard.robot,
            start_class=start.start_class,
            plan=as_it_is(motion),
            run=report,
            outcome=outcome,
        )

    def _play_where_it_lies(
        self, world: World, motion: Motion, body: BackendChoice, guard: SafetyGuard
    ) -> Rise:
        """Play on a robot that may be a real one: after the preflight, supervised, once."""
        import numpy as np

        from humanoid_getup.cli.session import recording
        from humanoid_getup.execution.attempt_manager import AttemptOptions
        from humanoid_getup.execution.get_up import get_up
        from humanoid_getup.strategies.stored_motion import StoredMotion

        options = AttemptOptions(
            max_attempts=1, torque_limit=self.torque_limit, pwm_limited=True, realtime=True
        )
        rng = np.random.default_rng(self.seed)
        with recording(self.out, world.robot, self._about(motion)) as recorder:
            return get_up(
                guard,
                world,
                StoredMotion(motion),
                rng,
                options,
                services=body.services,
                report=recorder.note,
                on_cycle=recorder.log,
            )

    def _about(self, motion: Motion) -> dict[str, str | int]:
        scene = {"seed": self.seed, "scene": self.scene}
        return {**scene, "backend": self.backend, "motion": motion.name}


def find_motion(robot: Robot, name: str) -> Motion:
    """Find a motion by name in the robot's database, or load an .npz file."""
    from humanoid_getup.motions.motion import Motion
    from humanoid_getup.motions.motion_database import load_database

    with refusing():
        if not name.endswith(".npz"):
            motions = {motion.name: motion for motion in load_database(robot).motions}
            if name not in motions:
                known = ", ".join(motions)
                raise ValueError(f"unknown motion '{name}', expected {known} or an .npz file")
            return motions[name]
        motion = Motion.load(Path(name))
        joints = motion.joint_pos.shape[1]
        if motion.robot != robot.name or joints != robot.n:
            raise ValueError(
                f"motion file {name}: made for '{motion.robot}' with {joints} joints, "
                f"expected '{robot.name}' with {robot.n}"
            )
        return motion
