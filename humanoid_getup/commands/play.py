"""`getup play MOTION`: play a rising motion as it is."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from rich.console import Console
from tyro.conf import Positional, arg

from drivers import GuardLimits, SafetyGuard, Twin
from humanoid_getup.build import settle_posture
from humanoid_getup.commands.errors import refusing
from humanoid_getup.commands.inputs import TrialOptions, find_start
from humanoid_getup.commands.results import hand_over
from humanoid_getup.database import load_database
from humanoid_getup.lying import Fall, read_posture
from humanoid_getup.motion import Motion
from humanoid_getup.rise import Rise, play, settle
from humanoid_getup.rise_plan import RisePlan, RiseStatus
from humanoid_getup.stage import Stage
from robots import Robot

OWN_START = "the motion's own"


@dataclass(frozen=True, kw_only=True)
class Play(TrialOptions):
    """Play a rising motion and judge how it ends."""

    motion: Annotated[Positional[str], arg(metavar="MOTION")]
    """A motion's name in the robot's database, or an .npz file."""
    origin: Annotated[str | None, arg(name="from", metavar="supine|prone|left|right|FILE")] = None
    """Class of the fall to draw, or a posture file; without it, the motion's own start."""

    def run(self) -> int:
        """Lie down and play."""
        stage = self.load_stage()
        motion = find_motion(stage.robot, self.motion)
        with Console(stderr=True).status("lying down") as status:
            guard, twin, start_class = self._lie_down(stage, motion)
            status.update("playing")
            limit = self.torque_limit
            report, watched = play(guard, twin, motion, limit, realtime=self.realtime)
            result = Rise(
                robot=stage.robot,
                start_class=start_class,
                plan=_as_it_is(motion),
                run=report,
                watched=watched,
            )
            status.update("drawing")
            extra = {"motion": motion.name, "strategy": motion.strategy}
            return hand_over(result, stage, self, self.origin or OWN_START, extra)

    def _lie_down(self, stage: Stage, motion: Motion) -> tuple[SafetyGuard, Twin, str]:
        robot = stage.robot
        twin = Twin(robot, stage.model)
        guard = SafetyGuard(twin, GuardLimits.of(robot, torque_limit=self.torque_limit))
        if self.origin is None:
            at_rest = settle_posture(stage, motion.posture(0))
            posture = read_posture(robot, stage.model, at_rest)
            fall = Fall(posture=posture, start_class=motion.start_class)
            twin.place(posture)
        else:
            fall = find_start(stage, self.origin, np.random.default_rng(self.seed))
            twin.place(fall.posture)
            settle(guard)
        return guard, twin, fall.start_class


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


def _as_it_is(motion: Motion) -> RisePlan:
    return RisePlan(
        status=RiseStatus.UNREHEARSED,
        reason="played as it is",
        motion=motion,
        connection=None,
        planned=False,
        stand_time=math.nan,
        robust=math.nan,
        rehearsals=0,
        rounds=0,
        plan_s=0.0,
        filter_s=0.0,
    )
