"""`getup eval POLICY`: how often, how fast and how hard a policy gets up."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from tyro.conf import Positional, arg

from humanoid_getup.cli.checks import at_least, between
from humanoid_getup.cli.errors import BadInputError, refusing
from humanoid_getup.cli.exit_codes import DID_IT
from humanoid_getup.cli.options import (
    PolicyName,
    PwmLimited,
    TorqueLimitOption,
    WorldOptions,
    load_policy,
)
from humanoid_getup.cli.output import (
    console_for,
    counting,
    find_file_faults,
    format_figure,
    phase,
    to_json,
    write_json,
)

if TYPE_CHECKING:
    from humanoid_getup.policy.onnx_policy import OnnxPolicy
    from humanoid_getup.simulation.falls import FallSet
    from humanoid_getup.simulation.world import World
    from sim2real.perturbations import Perturbation

FIGURES = ("n", "stood", "stood_interval_95", "stand_time_s", "rms_torque_nm", "head_impact_m_s")


@dataclass(frozen=True, kw_only=True)
class EvalPolicy(WorldOptions):
    """Evaluate a policy on settled falls that no training saw, by class, with intervals."""

    policy: Positional[PolicyName]
    n: Annotated[int, at_least(4, step=4)] = 1000
    """Number of falls, equally many of each class."""
    falls: Annotated[Path | None, arg(metavar="FILE")] = None
    """File of falls: read if it exists, else written."""
    torque_limit: TorqueLimitOption = None
    pwm_limited: PwmLimited = False
    delay: Annotated[float, between(0.0, 60.0, "ms"), arg(metavar="MS")] = 0.0
    """Delay of targets on their way to the servos [ms]."""
    voltage: Annotated[float | None, between(1.0, 30.0, "V"), arg(metavar="V")] = None
    """Supply voltage [V]; default: the robot's nominal one."""
    friction: Annotated[float | None, between(0.01, 10.0)] = None
    """Sliding friction coefficient of every contact; default: the scene's."""
    mass: Annotated[float, between(0.1, 10.0), arg(metavar="FACTOR")] = 1.0
    """Factor on the mass of every link."""
    backlash: Annotated[float, between(0.0, 10.0, "deg"), arg(metavar="DEG")] = 0.0
    """Backlash of every gear [deg]."""
    weak_servo: Annotated[float, between(0.0, 1.0), arg(metavar="FACTOR")] = 1.0
    """Factor on the torque of one servo, a different one in each robot."""
    push: Annotated[float, between(0.0, 10.0, "m/s"), arg(metavar="M/S")] = 0.0
    """Velocity change by a push in a random direction, once a second [m/s]."""
    imu_tilt: Annotated[float, between(0.0, 90.0, "deg"), arg(metavar="DEG")] = 0.0
    """Mounting error of the IMU about a random axis [deg]."""
    gyro_bias: Annotated[float, between(0.0, 360.0, "deg/s"), arg(metavar="DEG/S")] = 0.0
    """Bias of the gyro about a random axis [deg/s]."""
    noise: bool = False
    """Add the sensor noise of training."""
    physics: (
        Literal[
            "1 ms steps",
            "elliptic cones",
            "other solver",
            "soft contacts",
            "capsules",
            "menagerie servos",
        ]
        | None
    ) = None
    """Model variant to evaluate in; default: the physics of training."""

    def find_faults(self) -> list[str]:
        """Report all that is wrong beyond the type and range of single values."""
        faults = super().find_faults()
        return faults if self.falls is None else faults + find_file_faults(self.falls)

    def run(self) -> int:
        """Sample falls, let the policy get up from each, judge."""
        with phase("loading"):
            world = self.load_stage()
            policy = load_policy(world.robot, self.policy, self.torque_limit)
            from sim2real.perturbations import evaluate_policy, summarize_rollouts

            trial = self._make_trial(policy.action.pwm_limit)
        chosen = self._find_falls(world)
        falls = chosen.falls
        with counting("rises", len(falls)) as count:
            rises = evaluate_policy(
                policy.robot,
                policy.action,
                policy.act,
                [fall.posture for fall in falls],
                trial,
                self.seed,
                scene=self.scene,
                report=count,
            )
        about = {"falls_seed": chosen.seed, "falls_scene": chosen.scene, "trial": trial.label}
        from humanoid_getup.simulation.falls import CLASSES

        return self._hand_over(about | summarize_rollouts(falls, rises, CLASSES), policy)

    def _make_trial(self, pwm_limit: float) -> Perturbation:
        from sim2real.environment.model_variants import MENAGERIE_SERVOS
        from sim2real.perturbations import Perturbation

        if self.physics == MENAGERIE_SERVOS and (
            self.torque_limit or self.voltage or self.weak_servo < 1.0 or pwm_limit < 1.0
        ):
            raise BadInputError(
                f"--physics is '{self.physics}', expected without torque limit, voltage, weak "
                "servo and a policy's own limit of the supply: its servos are not motors"
            )
        return Perturbation(
            torque_limit=self.torque_limit,
            pwm_limited=self.pwm_limited,
            delay=self.delay / 1000.0,
            voltage=self.voltage,
            friction=self.friction,
            mass=self.mass,
            backlash=math.radians(self.backlash),
            weak_servo=self.weak_servo,
            push=self.push,
            imu_tilt=math.radians(self.imu_tilt),
            gyro_bias=math.radians(self.gyro_bias),
            noise=self.noise,
            physics=self.physics,
        )

    def _find_falls(self, world: World) -> FallSet:
        """Read the falls from their file, or sample them."""
        from humanoid_getup.simulation.falls import CLASSES, FallSet, sample_fall_set

        each = self.n // len(CLASSES)
        with phase("sampling falls"), refusing():
            if self.falls is not None and self.falls.exists():
                return FallSet.load(self.falls, world.robot).choose(each)
            falls = sample_fall_set(world, dict.fromkeys(CLASSES, each), self.seed)
            if self.falls is not None:
                falls.save(self.falls)
        return falls

    def _hand_over(self, figures: dict[str, Any], policy: OnnxPolicy) -> int:
        from humanoid_getup.policy.onnx_policy import find_policy

        about = {
            "name": "eval",
            "policy": str(find_policy(policy.robot, self.policy).stem),
            "seed": self.seed,
            "n": self.n,
            "robot": policy.robot.name,
            "scene": self.scene,
        }
        write_json(to_json(about | figures), self.json)
        from rich.table import Table

        table = Table(f"{about['policy']}: {figures['trial']}", *FIGURES, box=None)
        for name, row in (*figures["classes"].items(), ("all", figures["all"])):
            table.add_row(name, *(format_figure(row[figure]) for figure in FIGURES))
        console_for(self.json).print(table)
        return DID_IT
