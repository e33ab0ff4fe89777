"""`getup play MOTION`: play a rising motion as it is."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from rich.console import Console
from tyro.conf import Positional, arg

from humanoid_getup.cli.backends import BackendChoice
from humanoid_getup.cli.errors import refusing
from humanoid_getup.cli.options import RunOptions, find_start, find_start_faults
from humanoid_getup.cli.results import hand_over
from humanoid_getup.cli.session import WHERE_IT_LAY, open_session
from humanoid_getup.execution.get_up import get_up
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.simulation.falls import Fall, settle_posture
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.stored_motion import StoredMotion
from robots import Robot
from robots.kinematics import read_posture

OWN_START = "the motion's own"


@dataclass(frozen=True, kw_only=True)
class Play(RunOptions):
    """Play a rising motion and judge how it ends."""

    motion: Annotated[Positional[str], arg(metavar="MOTION")]
    """A motion's name in the robot's database, or an .npz file."""
    origin: Annotated[str | None, arg(name="from", metavar="supine|prone|left|right|FILE")] = None
    """Class of the fall to draw, or a posture file; without it, the motion's own start."""

    preflight: bool = True
    """Play only what the preflight passes; never without it on a real robot."""

    def find_faults(self) -> list[str]:
        """Return every problem of the options' values."""
        faults = super().find_faults()
        if self.is_real and not self.preflight:
            faults.append("no-preflight is given, expected only for a simulated robot")
        return faults + find_start_faults(self.origin, is_real=self.is_real, needs_one=False)

    def run(self) -> int:
        """Lie down, or find the robot lying, and play."""
        world = self.load_stage()
        motion = find_motion(world.robot, self.motion)
        with Console(stderr=True).status("lying down") as status, self.open_body(world) as body:
            start = self._lie_down(world, motion, body)
            own_start = start if self.origin is None else None
            with open_session(
                self,
                world,
                body,
                StoredMotion(motion),
                report=status.update,
                about={"motion": motion.name},
                start=own_start and own_start.posture,
                max_attempts=1,
                settle=own_start is None,
                preflight=self.preflight,
            ) as session:
                rng = np.random.default_rng(self.seed)
                result = get_up(session, rng, start_class=start and start.start_class)
            status.update("drawing")
            extra = {"motion": motion.name, "strategy": motion.strategy}
            origin = WHERE_IT_LAY if self.is_real else self.origin or OWN_START
            return hand_over(result, world, self, origin, extra)

    def _lie_down(self, world: World, motion: Motion, body: BackendChoice) -> Fall | None:
        """Put a simulated robot where it is to start; ``None`` for a real one."""
        if body.place is None:
            return None
        if self.origin is None:
            at_rest = settle_posture(world, motion.posture(0))
            posture = read_posture(world.robot, world.model, at_rest)
            start = Fall(posture=posture, start_class=motion.start_class)
        else:
            start = find_start(world, self.origin, np.random.default_rng(self.seed))
        body.place(start.posture)
        return start


def find_motion(robot: Robot, name: str) -> Motion:
    """Find a motion by name in the robot's database, or load an .npz file."""
    with refusing():
        if not name.endswith(".npz"):
            motions = {motion.name: motion for motion in load_database(robot).motions}
            if name not in motions:
                known = ", ".join(motions)
                raise ValueError(f"unknown motion '{name}': expected {known}, or an .npz file")
            return motions[name]
        motion = Motion.load(Path(name))
        joints = motion.joint_pos.shape[1]
        if motion.robot != robot.name or joints != robot.n:
            raise ValueError(
                f"motion file {name}: made for '{motion.robot}' with {joints} joints, "
                f"expected '{robot.name}' with {robot.n}"
            )
        return motion
