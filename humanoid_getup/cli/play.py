"""`getup play MOTION`: play a rising motion as it is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from rich.console import Console
from tyro.conf import Positional, arg

from drivers import GuardLimits, SafetyGuard
from drivers.twin.simulation import Simulation
from humanoid_getup.cli.backends import BackendChoice
from humanoid_getup.cli.errors import refusing
from humanoid_getup.cli.options import RunOptions, find_start, find_start_faults
from humanoid_getup.cli.results import hand_over
from humanoid_getup.cli.session import WHERE_IT_LAY, recording, stop_key
from humanoid_getup.evaluation.judge import GroundTruthJudge
from humanoid_getup.execution.attempt_manager import AttemptOptions
from humanoid_getup.execution.estimation import settle
from humanoid_getup.execution.get_up import Rise, get_up, play
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.simulation.falls import Fall, settle_posture
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.stored_motion import StoredMotion, as_it_is
from robots import Posture, Robot, TorqueLimit
from robots.kinematics import read_posture

OWN_START = "the motion's own"


@dataclass(frozen=True, kw_only=True)
class Play(RunOptions):
    """Play a rising motion and judge how it ends."""

    motion: Annotated[Positional[str], arg(metavar="MOTION")]
    """A motion's name in the robot's database, or an .npz file."""
    origin: Annotated[str | None, arg(name="from", metavar="supine|prone|left|right|FILE")] = None
    """Class of the fall to draw, or a posture file; without it, the motion's own start."""

    def find_faults(self) -> list[str]:
        """Tell all that is wrong with the options' values."""
        faults = super().find_faults()
        return faults + find_start_faults(self.origin, is_real=self.is_real, needs_one=False)

    def run(self) -> int:
        """Lie down, or find the robot lying, and play."""
        world = self.load_stage()
        motion = find_motion(world.robot, self.motion)
        with Console(stderr=True).status("lying down") as status, self.open_body(world) as body:
            status.update("playing")
            guard = SafetyGuard(body.backend, GuardLimits.of(world.robot, self.torque_limit))
            with stop_key(body, guard):
                if body.simulation is None or body.place is None:
                    rise = self._play_where_it_lies(world, motion, body, guard)
                else:
                    start = self._lie_down(world, motion, guard, body.place)
                    rise = self._play(motion, body, body.simulation, guard, start)
            status.update("drawing")
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
        options = AttemptOptions(
            max_attempts=1, torque_limit=TorqueLimit(self.torque_limit, "pwm"), realtime=True
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
    with refusing():
        if not name.endswith(".npz"):
            motions = {motion.name: motion for motion in load_database(robot).motions}
            if name not in motions:
                known = ", ".join(motions)
                raise ValueError(f"unknown motion '{name}': allowed {known}, or an .npz file")
            return motions[name]
        motion = Motion.load(Path(name))
        joints = motion.joint_pos.shape[1]
        if motion.robot != robot.name or joints != robot.n:
            raise ValueError(
                f"motion file {name}: made for '{motion.robot}' with {joints} joints, "
                f"allowed '{robot.name}' with {robot.n}"
            )
        return motion
