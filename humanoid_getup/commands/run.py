"""`getup run POLICY`: let a trained policy get the robot up."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from rich.console import Console
from tyro.conf import Positional, arg

from humanoid_getup.commands.inputs import TrialOptions, find_start, find_start_faults
from humanoid_getup.commands.policies import load_policy
from humanoid_getup.commands.results import hand_over
from humanoid_getup.commands.trials import WHERE_IT_LAY, try_to_rise
from humanoid_getup.policy import LONGEST
from humanoid_getup.policy_plan import ThePolicy


@dataclass(frozen=True, kw_only=True)
class RunPolicy(TrialOptions):
    """Run a trained policy once, supervised, and judge how it ends."""

    policy: Annotated[Positional[str], arg(metavar="POLICY")]
    """A policy's name in the robot's folder, or an .onnx file."""
    origin: Annotated[str | None, arg(name="from", metavar="supine|prone|left|right|FILE")] = None
    """How a simulated robot lies: class of the fall to draw, or a posture file."""

    longest: Annotated[float, arg(metavar="S")] = LONGEST
    """Time after which it ends, standing or not [s]."""

    def find_faults(self) -> list[str]:
        """Tell all that is wrong with the options' values."""
        faults = super().find_faults()
        faults += find_start_faults(self.origin, is_real=self.is_real, needs_one=True)
        if not 0.0 < self.longest < math.inf:
            faults.append(f"longest is {self.longest:g} s, allowed a finite number above 0 s")
        return faults

    def run(self) -> int:
        """Lie down, or find the robot lying, and let the policy rise."""
        stage = self.load_stage()
        policy = load_policy(stage.robot, self.policy, self.torque_limit, self.longest)
        plans = ThePolicy(policy, Path(self.policy).stem)
        rng = np.random.default_rng(self.seed)
        with Console(stderr=True).status("falling") as status, self.open_body(stage) as body:
            start = None if self.origin is None else find_start(stage, self.origin, rng)
            rise = try_to_rise(stage, body, plans, start, self, rng, attempts=1, tell=status.update)
            status.update("drawing")
            return hand_over(rise, stage, self, self.origin or WHERE_IT_LAY, {"method": "policy"})
