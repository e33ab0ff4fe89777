"""Identification of a servo type: least squares on logs, nested models, and intervals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import t as student

from robots.quaternion import Array
from robots.servo import ServoModel
from sim2real.identification.pendulums import PARAMETERS, Pendulums
from sim2real.identification.servo_log import ServoLog

MODELS = {
    "constant friction": 6,
    "friction by load": 8,
    "friction by load, and stiction": 10,
}
"""Nested models by their number of parameters, the first ones of `PARAMETERS`."""
STARTS, TRIED = 48, 5  # drawn about the data sheet; of them fitted
WIDE, NEAR = 0.5, 0.05  # spread of starts about the data sheet, and about a smaller model
FIRST_STEPS, MOST_STEPS = 6, 40  # of a descent: of each of those starts, and of the best
STEP = 1e-4  # of a parameter's scale, for finite differences
ROBUST = 0.2  # rad of error, beyond which an error counts in proportion and not squared
PARTS = 4  # refits for intervals, each without a part of the logs
BETTER = 0.98  # of the held-out error that a larger model has to come below
CONFIDENCE = 0.95
ALWAYS = PARAMETERS[:3]  # which no servo is without
AT_BOUND = 1.01  # times the lower bound: what is nearer is at it
OPEN = 0.5  # half an interval as a share of the value, beyond which a parameter is left open


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """A parameter with the 95 % interval of refits."""

    value: float
    lower: float
    upper: float

    @property
    def is_identified(self) -> bool:
        """Return whether the interval is narrow enough to use the value."""
        return self.upper - self.lower < 2.0 * OPEN * abs(self.value)


@dataclass(frozen=True, kw_only=True)
class ServoFit:
    """Parameters of a servo, and how far its simulation is from the logs."""

    model: str
    """Name of the model of friction."""
    parameters: dict[str, Estimate]
    errors: Array
    """Mean absolute error of the angle along each log [rad], (L,)."""
    held_out_error: float
    """Mean of that along logs that were not fitted [rad]."""
    at_bounds: tuple[str, ...] = ()
    """Parameters that would leave the range that is searched."""

    @property
    def not_identified(self) -> tuple[str, ...]:
        """Return the parameters that the logs leave open; an offset may be any share of itself."""
        figures = [name for name in self.parameters if name != "offset"]
        return tuple(name for name in figures if not self.parameters[name].is_identified)

    def apply(self, servo: ServoModel) -> ServoModel:
        """Return a servo type with the identified figures, at its nominal voltage."""
        absent = dict.fromkeys(PARAMETERS[MODELS[self.model] :], 0.0)
        absent.pop("stiction_speed", None)  # nothing is divided by 0
        values = absent | {name: one.value for name, one in self.parameters.items()}
        motor_constant, resistance = values.pop("motor_constant"), values.pop("resistance")
        values.pop("offset")
        stall_torque = motor_constant * servo.nominal_voltage / resistance
        return replace(
            servo,
            stall_torque=stall_torque,
            stall_current=servo.nominal_voltage / resistance,
            no_load_speed=servo.nominal_voltage / motor_constant,
            **values,
        )


class ServoFitter:
    """Fits the parameters of a servo type to logs."""

    def __init__(self, servo: ServoModel) -> None:
        """Take a servo type's data sheet as the start."""
        self._servo = servo
        stall, full = servo.stall_torque, servo.motor_constant
        # Data sheet, lower and upper bound of each parameter.
        rows = {
            "motor_constant": (full, 0.3 * full, 2.0 * full),
            "resistance": (servo.resistance, 0.2 * servo.resistance, 4.0 * servo.resistance),
            "armature": (servo.armature, 0.05 * servo.armature, 20.0 * servo.armature),
            "offset": (0.0, -0.2, 0.2),
            "friction": (servo.friction, 0.0, 0.5 * stall),
            "viscous_friction": (0.02 * stall, 0.0, stall),
            "load_friction": (0.2, 0.0, 0.9),
            "load_friction_slope": (0.1 / stall, 0.0, 2.0 / stall),
            "stiction": (0.05, 0.0, 0.9),
            "stiction_speed": (0.3, 0.01, 3.0),
        }
        assert tuple(rows) == PARAMETERS
        self._sheet, self._lower, self._upper = np.array(list(rows.values())).T
        self._none = np.where(np.arange(len(PARAMETERS)) < 6, self._sheet, 0.0)
        self._none[-1] = self._sheet[-1]  # a speed that nothing is divided by

    def fit(self, logs: Sequence[ServoLog], count: int, smaller: Array | None = None) -> Array:
        """Fit the first ``count`` parameters to logs; return all of them, (10,).

        It starts from the best of many points about the data sheet, and from the fit of a smaller
        model if there is one.
        """
        pendulums = Pendulums(logs, self._servo)
        rng = np.random.default_rng(0)
        starts = self._draw(self._sheet, WIDE, rng)
        if smaller is not None:
            new = smaller == self._none
            near = np.where(new, self._sheet, smaller)
            starts = np.concatenate([starts, self._draw(near, np.where(new, WIDE, NEAR), rng)])
        starts[:, count:] = self._none[count:]
        costs = _loss(_residuals(pendulums, starts))
        best = [starts[i] for i in np.argsort(costs)[:TRIED]]
        begun = np.array([self._descend(pendulums, start, count, FIRST_STEPS) for start in best])
        ahead = begun[int(np.argmin(_loss(_residuals(pendulums, begun))))]
        return self._descend(pendulums, ahead, count)

    def _draw(self, center: Array, spread: Array | float, rng: np.random.Generator) -> Array:
        """Draw points about one, with a spread of their logarithms, (STARTS, 10)."""
        factors = np.exp(rng.normal(0.0, 1.0, (STARTS, len(PARAMETERS))) * spread)
        return np.clip(center * factors, self._lower, self._upper)

    def refit(self, logs: Sequence[ServoLog], count: int, start: Array) -> Array:
        """Fit as `fit` does, to other logs of the same servo, from its result."""
        return self._descend(Pendulums(logs, self._servo), start, count)

    def _descend(
        self, pendulums: Pendulums, start: Array, count: int, most: int = MOST_STEPS
    ) -> Array:
        """Minimize the error from a start by Gauss-Newton steps within the bounds."""
        lower, upper = self._lower[:count], self._upper[:count]
        scale = np.where(start[:count] == 0.0, 0.1 * (upper - lower), np.abs(start[:count]))

        def complete(x: Array) -> Array:
            rows = np.tile(self._none, (len(x), 1))
            rows[:, :count] = x
            return rows

        def errors(x: Array) -> Array:
            return _residuals(pendulums, complete(x[None]))[0]

        def slopes(x: Array) -> Array:
            step = STEP * scale * np.where(x + STEP * scale > upper, -1.0, 1.0)
            found = _residuals(pendulums, complete(np.vstack([x, x + np.diag(step)])))
            return ((found[1:] - found[0]) / step[:, None]).T

        inside = np.clip(start[:count], lower + 1e-9 * scale, upper - 1e-9 * scale)
        found = least_squares(
            errors,
            inside,
            jac=slopes,  # pyright: ignore[reportArgumentType]
            bounds=(lower, upper),
            x_scale=scale,
            loss="soft_l1",
            f_scale=ROBUST,
            max_nfev=most,
            ftol=1e-4,
            xtol=1e-4,
        )
        return complete(found.x[None])[0]

    def measure(self, logs: Sequence[ServoLog], parameters: Array) -> Array:
        """Measure the mean absolute error of the angle along each log [rad], (L,)."""
        pendulums = Pendulums(logs, self._servo)
        error = np.abs(pendulums.run(parameters[None])[0] - pendulums.measured)
        return (error * pendulums.valid).sum(axis=1) / pendulums.valid.sum(axis=1)

    def measure_catalog(self, logs: Sequence[ServoLog], offset: float = 0.0) -> float:
        """Measure the mean error of the catalog's figures along logs, at an offset [rad]."""
        servo = self._servo
        own = {name: getattr(servo, name) for name in PARAMETERS if hasattr(servo, name)}
        own["offset"] = offset
        values = np.array([own.get(name, 0.0) for name in PARAMETERS])
        return float(self.measure(logs, values).mean())

    def identify(
        self,
        logs: Sequence[ServoLog],
        held_out: Sequence[ServoLog] = (),
        tell: Callable[[str], None] = lambda _: None,
    ) -> ServoFit:
        """Choose a model by logs that it was not fitted to.

        Without logs that are held out, each part of the logs is held out in turn.
        """
        best, chosen, whole = np.inf, ("", self._none, [self._none]), None
        for name, count in MODELS.items():
            tell(name)
            whole = self.fit(logs, count, whole)
            parts = [] if held_out else self._refit_parts(logs, count, whole)
            fitted = zip(split(logs), parts, strict=True)
            checks = [(held_out, whole)] if held_out else [(part, x) for (_, part), x in fitted]
            error = float(np.concatenate([self.measure(*check) for check in checks]).mean())
            if error < BETTER * best:
                best, chosen = error, (name, whole, parts)
        name, whole, parts = chosen
        parts = parts or self._refit_parts(logs, MODELS[name], whole)
        reach = compute_reach(np.array(parts))
        return ServoFit(
            model=name,
            parameters={
                PARAMETERS[i]: Estimate(
                    value=float(whole[i]),
                    lower=float(whole[i] - reach[i]),
                    upper=float(whole[i] + reach[i]),
                )
                for i in range(MODELS[name])
            },
            errors=self.measure(logs, whole),
            held_out_error=best,
            at_bounds=tuple(
                name
                for name, value, lower, upper in zip(
                    PARAMETERS, whole, self._lower, self._upper, strict=True
                )
                if name in ALWAYS and not AT_BOUND * lower < value < upper / AT_BOUND
            ),
        )

    def _refit_parts(self, logs: Sequence[ServoLog], count: int, whole: Array) -> list[Array]:
        """Fit to the logs without each of their parts."""
        return [self.refit(rest, count, whole) for rest, _ in split(logs)]


def split(logs: Sequence[ServoLog]) -> list[tuple[list[ServoLog], list[ServoLog]]]:
    """Split logs into what is left without each part, and the part.

    Parts are trajectories: a model of the wrong form fits each of them with other values. If there
    are fewer than three, parts run diagonally through what a bench repeats for several gains.
    """
    names = sorted({log.trajectory for log in logs})
    parts = min(PARTS, len(names) if len(names) > 2 else len(logs))
    of_log = [
        (names.index(log.trajectory) if len(names) > 2 else i + i // parts) % parts
        for i, log in enumerate(logs)
    ]
    owned = list(zip(logs, of_log, strict=True))
    return [
        ([log for log, own in owned if own != part], [log for log, own in owned if own == part])
        for part in range(parts)
    ]


def compute_reach(parts: Array) -> Array:
    """Compute half the interval of refits without each part of the logs, (P, 10) to (10,).

    Residuals keep their sign for tenths of a second, so the curvature of the cost, which counts
    every sample, makes intervals about eight times too narrow.
    """
    n = len(parts)
    spread = np.sqrt((n - 1) / n * np.sum((parts - parts.mean(axis=0)) ** 2, axis=0))
    return spread * student.ppf(0.5 + 0.5 * CONFIDENCE, n - 1)


def _residuals(pendulums: Pendulums, parameters: Array) -> Array:
    """Compute the errors of the angle for rows of parameters, (P, L * T); 0 beyond a log's end."""
    errors = (pendulums.run(parameters) - pendulums.measured) * pendulums.valid
    return errors.reshape(len(parameters), -1)


def _loss(errors: Array) -> Array:
    """Compute the robust cost of rows of errors, as the least squares do, (P,)."""
    return np.sum(np.sqrt(1.0 + (errors / ROBUST) ** 2) - 1.0, axis=1)
