"""`getup eval POLICY`: how often, how fast and how hard a policy gets up."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from rich.console import Console
from rich.table import Table
from tyro.conf import Positional, arg

from humanoid_getup.cli.errors import BadInputError, refusing
from humanoid_getup.cli.exit_codes import DID_IT
from humanoid_getup.cli.options import WorldOptions, find_policy, find_torque_faults, load_policy
from humanoid_getup.cli.output import (
    console_for,
    counting,
    find_file_faults,
    format_figure,
    to_json,
    write_json,
)
from humanoid_getup.policy.onnx_policy import OnnxPolicy
from humanoid_getup.simulation.falls import CLASSES, FallSet, sample_fall_set
from humanoid_getup.simulation.world import World

if TYPE_CHECKING:
    from sim2real.perturbations import Perturbation

FIGURES = ("n", "stood", "stood_interval_95", "stand_time_s", "rms_torque_nm", "head_impact_m_s")


@dataclass(frozen=True, kw_only=True)
class EvalPolicy(WorldOptions):
    """Evaluate a policy on settled falls that no training saw, by class, with intervals."""

    policy: Annotated[Positional[str], arg(metavar="POLICY")]
    """A policy's name in the robot's folder, or an .onnx file."""
    n: int = 1000
    """Falls, as many of each class; a multiple of 4."""
    falls: Annotated[Path | None, arg(metavar="FILE")] = None
    """Keep the drawn falls in a file, and take them from there when it exists."""
    torque_limit: Annotated[float | None, arg(metavar="N·m")] = None
    """Cap on every servo [N·m]; without it, what the servos can."""
    pwm_limited: bool = False
    """Let the cap be a PWM limit, as servos in position mode have it."""
    delay: Annotated[float, arg(metavar="MS")] = 0.0
    """Age of targets when the servos get them [ms]."""
    voltage: Annotated[float | None, arg(metavar="V")] = None
    """Supply [V]; without it, the robot's nominal one."""
    friction: float | None = None
    """Sliding friction of every contact; without it, the scene's."""
    mass: Annotated[float, arg(metavar="SHARE")] = 1.0
    """Share of every link's mass."""
    backlash: Annotated[float, arg(metavar="DEG")] = 0.0
    """Free play between every gear and its link [deg]."""
    weak_servo: Annotated[float, arg(metavar="SHARE")] = 1.0
    """Share of its torque that one servo has, another in every robot."""
    push: Annotated[float, arg(metavar="M/S")] = 0.0
    """Speed of a push in a random direction, once a second [m/s]."""
    imu_tilt: Annotated[float, arg(metavar="DEG")] = 0.0
    """How far the IMU is turned about a random axis [deg]."""
    gyro_bias: Annotated[float, arg(metavar="DEG/S")] = 0.0
    """What the gyro tells too much, about a random axis [deg/s]."""
    noise: bool = False
    """Let the sensors be as noisy as in training."""
    physics: str | None = None
    """Other physics, by name: 1 ms steps, elliptic cones, other solver, soft contacts, capsules,
    menagerie servos."""

    def find_faults(self) -> list[str]:
        """Tell all that is wrong with the options' values."""
        faults = super().find_faults() + find_torque_faults(self.torque_limit)
        if self.n < len(CLASSES) or self.n % len(CLASSES):
            faults.append(f"n is {self.n}, allowed a multiple of {len(CLASSES)}")
        if self.falls is not None:
            faults += find_file_faults(self.falls)
        for name, lower, upper, unit in (
            ("delay", 0.0, 60.0, "ms"),
            ("voltage", 1.0, 30.0, "V"),
            ("friction", 0.01, 10.0, ""),
            ("mass", 0.1, 10.0, ""),
            ("backlash", 0.0, 10.0, "deg"),
            ("weak_servo", 0.0, 1.0, ""),
            ("push", 0.0, 10.0, "m/s"),
            ("imu_tilt", 0.0, 90.0, "deg"),
            ("gyro_bias", 0.0, 360.0, "deg/s"),
        ):
            value = getattr(self, name)
            if value is not None and not lower <= value <= upper:
                told = f"{name.replace('_', '-')} is {value:g} {unit}".rstrip()
                faults.append(f"{told}, allowed {lower:g} to {upper:g} {unit}".rstrip())
        return faults

    def run(self) -> int:
        """Draw falls, let the policy get up from each, judge."""
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
        return self._hand_over(about | summarize_rollouts(falls, rises, CLASSES), policy)

    def _make_trial(self, pwm_limit: float) -> Perturbation:
        from sim2real.environment.model_variants import MENAGERIE_SERVOS, MODEL_VARIANTS
        from sim2real.perturbations import Perturbation

        if self.physics is not None and self.physics not in MODEL_VARIANTS:
            raise BadInputError(
                f"unknown physics '{self.physics}': allowed {', '.join(sorted(MODEL_VARIANTS))}"
            )
        if self.physics == MENAGERIE_SERVOS and (
            self.torque_limit or self.voltage or self.weak_servo < 1.0 or pwm_limit < 1.0
        ):
            raise BadInputError(
                f"physics is '{self.physics}', allowed without torque limit, voltage, weak servo, "
                "and a policy's own limit of the supply: its servos are not motors"
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
        """Read the falls that are kept, or draw them."""
        if self.falls is not None and self.falls.exists():
            with refusing():
                return FallSet.load(self.falls, world.robot).choose(self.n // len(CLASSES))
        counts = {kind: self.n // len(CLASSES) for kind in CLASSES}
        with Console(stderr=True).status("falling"):
            falls = sample_fall_set(world, counts, self.seed)
        if self.falls is not None:
            falls.save(self.falls)
        return falls

    def _hand_over(self, figures: dict[str, Any], policy: OnnxPolicy) -> int:
        about = {
            "name": "eval",
            "policy": str(find_policy(policy.robot, self.policy).stem),
            "seed": self.seed,
            "n": self.n,
            "robot": policy.robot.name,
            "scene": self.scene,
        }
        write_json(to_json(about | figures), self.json)
        table = Table(f"{about['policy']}: {figures['trial']}", *FIGURES, box=None)
        for name, row in (*figures["classes"].items(), ("all", figures["all"])):
            table.add_row(name, *(format_figure(row[figure]) for figure in FIGURES))
        console_for(self.json).print(table)
        return DID_IT
