"""`getup bench methods`: planned and learned rises side by side."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from tyro.conf import arg

from humanoid_getup.attempt import Plans
from humanoid_getup.bench.methods import bench_methods
from humanoid_getup.bench.rise import CLASSES
from humanoid_getup.commands.bench import BenchOptions
from humanoid_getup.commands.errors import refusing
from humanoid_getup.commands.inputs import find_torque_faults
from humanoid_getup.commands.policies import load_policy
from humanoid_getup.commands.tables import counting
from humanoid_getup.database import load_database
from humanoid_getup.policy_plan import ThePolicy
from humanoid_getup.records import PLAN
from humanoid_getup.rise_plan import RiseOptions
from humanoid_getup.rising import RisePlanner
from humanoid_getup.stage import Stage

FIGURES = (
    "n",
    "stood",
    "stand_time_s",
    "peak_torque_nm",
    "rms_torque_nm",
    "head_impact_m_s",
    "hottest_after_ten_rises_c",
)


@dataclass(frozen=True, kw_only=True)
class BenchMethods(BenchOptions):
    """Get up from the same falls by plans and by policies: success, time, load, impact, heat."""

    n: int = 20
    """Falls of each class: supine, prone, lateral."""
    ways: tuple[str, ...] = (PLAN, "robust")
    """What to compare: plan, and policies by name or file."""
    torque_limit: Annotated[float | None, arg(metavar="N·m")] = None
    """Cap on every servo [N·m]; without it, what the servos can."""
    pwm_limited: bool = False
    """Let the cap be a PWM limit, as servos in position mode have it."""

    def find_faults(self) -> list[str]:
        """Tell all that is wrong with the options' values."""
        return super().find_faults() + find_torque_faults(self.torque_limit)

    def run(self) -> int:
        """Run the benchmark."""
        stage = self.load_stage()
        ways = {name: self._make_plans(stage, name) for name in self.ways}
        with counting("rises", len(CLASSES) * self.n * len(ways)) as count:
            result = bench_methods(
                stage,
                ways,
                seed=self.seed,
                each=self.n,
                torque_limit=self.torque_limit,
                pwm_limited=self.pwm_limited,
                report=lambda _: count(1),
            )
        return self.hand_over(result, FIGURES)

    def _make_plans(self, stage: Stage, name: str) -> Plans:
        if name != PLAN:
            return ThePolicy(load_policy(stage.robot, name, self.torque_limit), name)
        with refusing():
            database = load_database(stage.robot)
        options = RiseOptions(torque_limit=self.torque_limit, pwm_limited=self.pwm_limited)
        return RisePlanner(stage, database, options)
