"""One description of a policy that was trained elsewhere, whatever file it comes from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from humanoid_getup.policy.action import ActionMode
from robots.quaternion import Array

if TYPE_CHECKING:
    from onnx import ModelProto

FOREIGN_KEY = "foreign_policy"  # in the metadata of an imported policy
COMMAND = "command"
NAMES = {
    "gyro": ("base_ang_vel", "ang_vel", "gyro", "imu_ang_vel", "builtin_sensor"),
    "gravity": ("projected_gravity", "gravity", "gravity_orientation"),
    "joint_pos": ("joint_pos_rel", "joint_pos", "dof_pos"),
    "joint_vel": ("joint_vel_rel", "joint_vel", "dof_vel"),
    "last_action": ("last_action", "actions", "action", "prev_actions", "previous_actions"),
    COMMAND: ("command", "commands", "generated_commands", "velocity_commands"),
}
"""Names of terms in other projects, by those of our observation and for commands, which are 0."""
IMMEASURABLE = {
    "base_lin_vel": "linear velocity of the base",
    "lin_vel": "linear velocity of the base",
    "root_lin_vel_w": "linear velocity of the base",
    "root_pos_w": "position of the base",
    "base_pos_z": "height of the base",
    "base_height": "height of the base",
    "height_scan": "heights of the ground",
    "contact_forces": "contact forces",
    "feet_contact": "contacts of the feet",
    "foot_contact": "contacts of the feet",
}
MOST_HISTORY = 200


class ForeignPolicyError(ValueError):
    """A policy that was trained elsewhere cannot be run; the message names every problem."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ForeignNetwork:
    """A network in an ONNX file that was trained elsewhere."""

    model: ModelProto
    metadata: dict[str, str]
    observation: int
    """Size of its input."""
    action: int
    """Size of its output."""


class Window(msgspec.Struct, frozen=True, kw_only=True):
    """A term's part of the observation of a policy."""

    name: str
    quantity: str
    """A key of `NAMES`, or a term of our observation."""
    size: int
    history: int = 1
    """Number of policy steps that it holds, the oldest first."""


class ForeignRecord(msgspec.Struct, frozen=True, kw_only=True):
    """What an imported policy keeps of its description in its own metadata, for checks."""

    format: str
    joints: tuple[str, ...]
    """The robot's names of its joints, in the order of its observation."""
    moved: tuple[str, ...]
    """The robot's names of the joints that actions move, in the order of its actions."""
    windows: tuple[Window, ...]
    scale: tuple[float, ...] = ()
    """Changes of targets by an action of 1 [rad], in the order of ``moved``."""
    damping: tuple[float, ...] = ()
    """Gains kd of its training [N·m·s/rad], in the order of ``joints``; () if not known."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ForeignTerm:
    """A term of an observation: a quantity, clipped, then scaled, then kept for some steps."""

    name: str
    quantity: str
    scale: Array
    """Factors, shape (size,)."""
    lower: float = -np.inf
    """Lower limit before the factors."""
    upper: float = np.inf
    """Upper limit before the factors."""
    history: int = 1
    is_offset: bool = True
    """Whether joint angles are counted from the default posture."""

    @property
    def size(self) -> int:
        """Return the size of the quantity."""
        return len(self.scale)


@dataclass(frozen=True, kw_only=True, eq=False)
class ForeignPolicy:
    """Properties of a policy that was trained elsewhere; n joints, of which actions move k."""

    format: str
    joints: tuple[str, ...]
    """Its names of the joints, in the order of its observations."""
    default_pos: Array
    """Joint angles from which observations count [rad], shape (n,)."""
    moved: tuple[str, ...]
    """Its names of the joints that actions move, in the order of the actions."""
    mode: ActionMode = ActionMode.ABSOLUTE
    """What an action is added to; absolute: ``offset``."""
    scale: Array
    """Change of a target by an action of 1 [rad], shape (k,)."""
    offset: Array
    """Targets of actions of 0 in mode absolute [rad], shape (k,)."""
    position_gain: Array | None = None
    """Gains kp [N·m/rad], shape (n,); ``None`` if not known."""
    p_gain: float | None = None
    """The servos' Position P Gain, a register value, where that is what is known."""
    damping: Array | None = None
    """Gains kd [N·m·s/rad], shape (n,); ``None`` if not known."""
    rate: float
    """Policy steps per second [Hz]."""
    observation: tuple[ForeignTerm, ...]
    sources: dict[str, str]
    """Where each field comes from."""
    limits: Array | None = None
    """Lower and upper limits of targets [rad], shape (2, k); ``None`` for none."""

    @property
    def observation_size(self) -> int:
        """Return the size of its observation."""
        return sum(term.size * term.history for term in self.observation)

    def describe(self) -> list[tuple[str, str, str]]:
        """List field, value and source, for people."""
        gain = "the robot's" if self.p_gain is None else f"register value {self.p_gain:g}"
        if self.position_gain is not None:
            gain = f"{_range(self.position_gain)} N·m/rad"
        terms = (
            f"{term.name}[{term.size}{f' x {term.history}' * (term.history > 1)}]"
            for term in self.observation
        )
        values = {
            "joints": f"{len(self.joints)}: {', '.join(self.joints)}",
            "default_pos": f"{_range(self.default_pos)} rad",
            "action": f"{self.mode}, scale {_range(self.scale)} rad",
            "position_gain": gain,
            "damping": "the robot's",
            "rate": f"{self.rate:g} Hz",
            "observation": " ".join(terms),
        }
        if self.damping is not None:
            values["damping"] = f"{_range(self.damping)} N·m·s/rad"
        return [(name, text, self.sources[name]) for name, text in values.items()]


def _range(values: Array) -> str:
    low, high = float(np.min(values)), float(np.max(values))
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"


def spread(values: Any, size: int, what: str) -> Array:
    """Return ``size`` numbers: those of a list of that length, or one number for all.

    Raises:
        ForeignPolicyError: if they are neither.
    """
    try:
        array = np.atleast_1d(np.asarray(values, dtype=float))
    except (TypeError, ValueError, OverflowError):
        raise ForeignPolicyError(f"{what} is {values!r:.60}, expected numbers") from None
    if array.shape not in ((1,), (size,)):
        raise ForeignPolicyError(f"{what} has shape {array.shape}, expected ({size},)")
    if not np.isfinite(array).all():
        raise ForeignPolicyError(f"{what} holds {array[~np.isfinite(array)][0]}, expected finite")
    return np.resize(array, size)


def find_quantity(name: str) -> str:
    """Find the quantity of a term by its name; "" if it is not known."""
    # What a policy of motions tracks is no wish of a user.
    if name.endswith(("_command", "_commands")) and not name.startswith("motion"):
        return COMMAND
    return next((quantity for quantity, names in NAMES.items() if name in names), "")


def check_terms(names: Sequence[str]) -> None:
    """Refuse terms that no robot measures, and unknown ones.

    Raises:
        ForeignPolicyError: naming all of them.
    """
    problems = [
        f"observation '{name}' is the {IMMEASURABLE[name]}, which the robot does not measure: "
        "train a policy without it"
        for name in names
        if name in IMMEASURABLE
    ]
    known = ", ".join(known[0] for quantity, known in NAMES.items() if quantity != COMMAND)
    problems += [
        f"observation '{name}' is unknown, expected {known}, *_commands"
        for name in names
        if name not in IMMEASURABLE and not find_quantity(name)
    ]
    if problems:
        raise ForeignPolicyError("; ".join(problems))


def find_size(name: str, joints: int, actions: int) -> int | None:
    """Return the size of a term; ``None`` for a command, whose size its name does not say."""
    quantity = find_quantity(name)
    if quantity == COMMAND:
        return 3 if "velocity" in name or "vel" in name.split("_") else None
    return {"gyro": 3, "gravity": 3, "last_action": actions}.get(quantity, joints)


def make_term(
    name: str,
    size: int,
    *,
    scale: Any = None,
    clip: Any = None,
    history: Any = 1,
    is_offset: bool = True,
    label: str = "",
) -> ForeignTerm:
    """Make a term whose quantity its name tells; a label is what messages call it.

    Raises:
        ForeignPolicyError: if a value does not fit.
    """
    owner = f"observation '{label or name}'"
    try:
        lower, upper = (-np.inf, np.inf) if clip is None else map(float, clip)
    except (TypeError, ValueError, OverflowError):
        raise ForeignPolicyError(f"{owner}: clip is {clip!r:.40}, expected two numbers") from None
    if not lower < upper:
        raise ForeignPolicyError(f"{owner}: clip is {lower:g} to {upper:g}, expected a range")
    if not isinstance(history, int) or not 0 <= history <= MOST_HISTORY:
        raise ForeignPolicyError(
            f"{owner}: history is {history!r:.40}, expected 0 to {MOST_HISTORY} steps"
        )
    return ForeignTerm(
        name=label or name,
        quantity=find_quantity(name),
        scale=spread(1.0 if scale is None else scale, size, f"{owner}: scale"),
        lower=lower,
        upper=upper,
        history=max(history, 1),
        is_offset=is_offset,
    )
