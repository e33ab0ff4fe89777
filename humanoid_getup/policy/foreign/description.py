"""One description of a policy that was trained elsewhere, whatever file it comes from."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from humanoid_getup.policy.action import ActionMode
from robots.quaternion import Array


class ForeignFormat(StrEnum):
    """Where a description of a policy comes from."""

    MJLAB = "mjlab"
    MICRODUCK = "microduck"
    UNITREE = "unitree"
    ISAAC = "isaac"
    LEGGED_GYM = "legged-gym"


class ForeignPolicyError(ValueError):
    """A policy that was trained elsewhere cannot be run; the message names every problem."""

    def __init__(self, *problems: str) -> None:
        super().__init__("; ".join(problems))
        self.problems = problems


class Quantity(StrEnum):
    """A quantity that a policy may observe and that a robot measures or knows."""

    GYRO = "gyro"
    GRAVITY = "gravity"
    JOINT_POS = "joint_pos"
    JOINT_VEL = "joint_vel"
    LAST_ACTION = "last_action"
    COMMAND = "command"


@dataclass(frozen=True, kw_only=True, eq=False)
class ForeignTerm:
    """A term of an observation: a quantity, clipped, then scaled, then kept for some steps."""

    name: str
    quantity: Quantity
    scale: Array
    """Factors, shape (size,)."""
    lower: float = -np.inf
    """Lower limit before the factors."""
    upper: float = np.inf
    """Upper limit before the factors."""
    history: int = 1
    """Number of policy steps that it holds, the oldest first."""
    is_offset: bool = True
    """Whether joint angles are counted from the default posture."""

    @property
    def size(self) -> int:
        """Return the size of the quantity."""
        return len(self.scale)


@dataclass(frozen=True, kw_only=True, eq=False)
class ForeignPolicy:
    """Properties of a policy that was trained elsewhere; n joints, of which actions move k."""

    format: ForeignFormat
    joints: tuple[str, ...]
    """Its names of the joints, in the order of its observations."""
    default_pos: Array
    """Joint angles from which observations count [rad], shape (n,)."""
    moved: tuple[str, ...]
    """Its names of the joints that actions move, in the order of the actions."""
    mode: ActionMode
    """What an action is added to; absolute: ``offset``."""
    scale: Array
    """Change of a target by an action of 1 [rad], shape (k,)."""
    offset: Array
    """Targets of actions of 0 in mode absolute [rad], shape (k,)."""
    position_gain: Array | None
    """Gains kp [N·m/rad], shape (n,); ``None`` if not known."""
    p_gain: float | None = None
    """The servos' Position P Gain, a register value, where that is what is known."""
    damping: Array | None
    """Gains kd [N·m·s/rad], shape (n,); ``None`` if not known."""
    rate: float
    """Policy steps per second [Hz]."""
    observation: tuple[ForeignTerm, ...]
    sources: dict[str, str]
    """Where each field comes from."""
    action_limit: float = np.inf
    """Largest size of an action that counts."""
    lower: Array | None = None
    """Lower limits of targets [rad], shape (k,); ``None`` for none."""
    upper: Array | None = None
    """Upper limits of targets [rad], shape (k,); ``None`` for none."""

    @property
    def observation_size(self) -> int:
        """Return the size of its observation."""
        return sum(term.size * term.history for term in self.observation)

    def windows(self) -> Iterator[tuple[ForeignTerm, slice]]:
        """Yield its terms with their places in an observation."""
        start = 0
        for term in self.observation:
            end = start + term.size * term.history
            yield term, slice(start, end)
            start = end

    def describe(self) -> list[tuple[str, str, str]]:
        """List field, value and source, for people."""
        damping = self.damping
        terms = " ".join(f"{t.name}[{t.size}{_times(t.history)}]" for t in self.observation)
        values = {
            "joints": f"{len(self.joints)}: {', '.join(self.joints)}",
            "default_pos": f"{_spread(self.default_pos)} rad",
            "action": f"{self.mode}, scale {_spread(self.scale)} rad",
            "position_gain": self._describe_gain(),
            "damping": "the robot's" if damping is None else f"{_spread(damping)} N·m·s/rad",
            "rate": f"{self.rate:g} Hz",
            "observation": terms,
        }
        return [(name, text, self.sources.get(name, "")) for name, text in values.items()]

    def _describe_gain(self) -> str:
        if self.position_gain is not None:
            return f"{_spread(self.position_gain)} N·m/rad"
        return "the robot's" if self.p_gain is None else f"register value {self.p_gain:g}"


@dataclass(frozen=True, kw_only=True)
class Given:
    """What a user says about a policy; it counts more than what files say."""

    joints: tuple[str, ...] = ()
    """Names of the joints, where files only number them."""
    rate: float | None = None
    """[Hz]"""
    gain: float | None = None
    """Position gain of all joints [N·m/rad]."""


@dataclass(frozen=True, kw_only=True)
class NetworkShape:
    """What a network tells by itself."""

    metadata: dict[str, str]
    observation: int
    """Size of its input."""
    action: int
    """Size of its output."""


def spread(values: Sequence[float] | float, size: int, what: str) -> Array:
    """Return ``size`` numbers: those of a list of that length, or one number for all.

    Raises:
        ForeignPolicyError: if they are neither.
    """
    try:
        array = np.asarray(values, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise ForeignPolicyError(f"{what} is {values!r:.60}, expected numbers") from None
    if array.ndim == 0 or array.shape == (1,):
        array = np.full(size, float(array.reshape(-1)[0]))
    if array.shape != (size,):
        raise ForeignPolicyError(f"{what} has shape {array.shape}, expected ({size},)")
    if not np.isfinite(array).all():
        raise ForeignPolicyError(f"{what} holds {array[~np.isfinite(array)][0]}, expected finite")
    return array


def _spread(values: Array) -> str:
    low, high = float(np.min(values)), float(np.max(values))
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"


def _times(history: int) -> str:
    return "" if history == 1 else f" x {history}"
