"""Identify virtual servos with hidden figures, and count how often the intervals hold the truth.

Their figures are drawn about those of catalog types. Every third has another form of friction than
the one that is fitted: stiction that fades with the square of the speed, or friction by the load of
gears, that of motor and weight together. Each moves a weight along four trajectories with four P
gains, for 5 s, seen through its encoder; the logs of one gain are held out.

    python benchmarks/identify_servos.py --n 24 --json identify_servos.json
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import tyro
from script import WorkOptions, do_pieces, write_results

from humanoid_getup.experiments.judging.summary import wilson_interval
from robots.description.servo_catalog import servo_models
from robots.quaternion import Array
from robots.servo import ServoModel
from sim2real.identification.pendulums import GRAVITY, PARAMETERS, Pendulums
from sim2real.identification.servo_fit import Estimate, ServoFitter
from sim2real.identification.servo_log import PERIOD, ServoLog

TYPES = ("XL330-M288", "XC330-T288", "XM430-W350", "XM540-W270", "MX-64(2.0)", "STS3215-C001")
LENGTH = 5.0  # s of a log
GAINS, HELD_OUT = (0.25, 0.5, 1.0, 2.0), 1  # shares of the P gain as shipped; place of the held out


@dataclass(frozen=True, kw_only=True)
class IdentifyOptions(WorkOptions):
    """Options of this script."""

    n: int = 24
    """Virtual servos."""
    first: int = 0
    """Number of the first one, to measure in pieces."""


class SquareStiction(Pendulums):
    """Servos whose stiction is down to 37 % at a speed, but fades with its square."""

    SHARED = PARAMETERS[:8]

    def compute_friction(
        self,
        motor: Array,
        weight: Array,  # noqa: ARG002
        v: Array,
        figures: Sequence[Array],
    ) -> Array:
        """Compute the dry friction."""
        c0, a, b, c, vs = figures
        load = np.abs(motor)
        return c0 + load * (a + b * load + c * np.exp(-((v / vs) ** 2)))


class GearLoad(Pendulums):
    """Servos whose friction is by what their gears carry, half of motor and half of weight."""

    SHARED = PARAMETERS[:6]

    def compute_friction(
        self, motor: Array, weight: Array, v: Array, figures: Sequence[Array]
    ) -> Array:
        """Compute the dry friction."""
        carried = 0.5 * (np.abs(motor) + np.abs(weight))
        return super().compute_friction(carried, weight, v, figures)


FORMS = {"the fitted form": Pendulums, "square stiction": SquareStiction, "gear load": GearLoad}


@dataclass(frozen=True, kw_only=True)
class Found:
    """What was identified of one virtual servo."""

    servo: str
    form: str
    model: str
    truth: dict[str, float]
    parameters: dict[str, Estimate]


def main(options: IdentifyOptions) -> dict[str, Any]:
    """Identify all, and write the coverage of every parameter."""
    numbers = range(options.first, options.first + options.n)
    found = do_pieces(partial(identify, options.seed), numbers, options)
    cases = {form: summarize([f for f in found if f.form == form], PARAMETERS) for form in FORMS}
    cases |= {name: summarize(found, (name,)) for name in PARAMETERS} | {
        "all": summarize(found, PARAMETERS)
    }
    result = {"name": "identify_servos", "seed": options.seed, "n": options.n, "cases": cases}
    result["servos"] = found
    figures = ("intervals", "covered", "interval_95", "identified", "median_error")
    write_results(result, figures, options.json)
    return result


def identify(seed: int, number: int) -> Found:
    """Draw a virtual servo, record its logs, and identify it from its type's data sheet."""
    rng = np.random.default_rng((seed, number))
    model = servo_models()[str(rng.choice(TYPES))]
    other = list(FORMS)[1 + number // 3 % 2]
    form = other if number % 3 == 2 else next(iter(FORMS))
    truth = draw_figures(model, rng)
    logs, held_out = record(model, FORMS[form], truth, rng)
    fit = ServoFitter(model).identify(logs, held_out)
    shared = getattr(FORMS[form], "SHARED", PARAMETERS)
    figures = {name: one for name, one in fit.parameters.items() if name in shared}
    return Found(
        servo=model.name,
        form=form,
        model=fit.model,
        truth=dict(zip(PARAMETERS, truth.tolist(), strict=True)),
        parameters=figures,
    )


def draw_figures(model: ServoModel, rng: np.random.Generator) -> Array:
    """Draw figures about those of a type, and friction as gears have it, (10,)."""
    stall = model.stall_torque
    K, R = np.array([model.motor_constant, model.resistance]) * rng.uniform(0.75, 1.15, 2)
    armature = model.armature * rng.uniform(0.5, 1.6)
    plain = rng.uniform((-0.02, 0.01 * stall, 0.005 * stall), (0.02, 0.04 * stall, 0.02 * stall))
    by_load = rng.uniform((0.1, 0.02 / stall, 0.03, 0.2), (0.35, 0.3 / stall, 0.15, 0.7))
    return np.array([K, R, armature, *plain, *by_load])


def record(
    model: ServoModel, form: type[Pendulums], truth: Array, rng: np.random.Generator
) -> tuple[list[ServoLog], list[ServoLog]]:
    """Record the logs of a servo; return those to fit, and those that are held out."""
    t = np.arange(0.0, LENGTH, PERIOD)
    ramp = np.clip(np.abs((t / 1.2) % 4.0 - 2.0) - 0.5, 0.0, 1.0)
    lift = np.clip(t / 2.0, 0.0, 1.0)
    goals = {
        "sin_sin": 0.9 * np.sin(2.0 * t) + 0.6 * np.sin(5.0 * t),
        "lift_and_drop": -0.5 * np.pi * lift,
        "up_and_down": 0.5 * np.pi * (1.0 - ramp),
        "sin_time_square": np.sin(t**2),
    }
    arm = 0.1 if model.stall_torque < 2.0 else 0.2
    mass = rng.uniform(0.3, 0.6) * model.stall_torque / GRAVITY / arm
    blank = ServoLog(
        name="",
        checksum="",
        servo=model.name,
        period=PERIOD,
        goal=t,
        joint_pos=np.zeros(len(t)),
        torque_on=np.ones(len(t), dtype=bool),
        start_speed=0.0,
        p_gain=model.p_gain,
        voltage=model.nominal_voltage,
        mass=mass,
        arm=arm,
    )
    logs = [
        replace(
            blank,
            name=f"{name} at {gain}",
            trajectory=name,
            goal=goal,
            torque_on=(t < 2.5) | (name != "lift_and_drop"),
            p_gain=gain * model.p_gain,
        )
        for gain in GAINS
        for name, goal in goals.items()
    ]
    step = model.rad_per_tick
    angles = np.round(form(logs, model).run(truth[None])[0] / step) * step
    logs = [replace(log, joint_pos=angle) for log, angle in zip(logs, angles, strict=True)]
    held_out = slice(HELD_OUT * len(goals), (HELD_OUT + 1) * len(goals))
    return [log for log in logs if log not in logs[held_out]], logs[held_out]


def summarize(found: Sequence[Found], names: Sequence[str]) -> dict[str, Any]:
    """Count the intervals of parameters that hold the truth."""
    pairs = [
        (one, f.truth[name]) for f in found for name, one in f.parameters.items() if name in names
    ]
    covered = sum(one.lower <= true <= one.upper for one, true in pairs)
    errors = [abs(one.value / true - 1.0) for one, true in pairs]
    return {
        "intervals": len(pairs),
        "covered": covered / max(1, len(pairs)),
        "interval_95": wilson_interval(covered, len(pairs)),
        "identified": sum(one.is_identified for one, _ in pairs) / max(1, len(pairs)),
        "median_error": float(np.median(errors)) if errors else None,
    }


if __name__ == "__main__":
    main(tyro.cli(IdentifyOptions))
