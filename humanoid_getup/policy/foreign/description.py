"""One description of a policy that was trained elsewhere, whatever file it comes from."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from humanoid_getup.policy.action import ActionMode
from robots import Robot
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
SIDES = {"left": "l", "right": "r"}
EMPTY = ("joint", "dof", "motor", "act", "actuator", "")  # words of joints that tell nothing


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


class ForeignTerm(Window, frozen=True, kw_only=True, eq=False):
    """A term of an observation: a quantity, clipped, then scaled, then kept for some steps."""

    scale: Array
    """Factors, shape (size,)."""
    lower: float = -np.inf
    """Lower limit before the factors."""
    upper: float = np.inf
    """Upper limit before the factors."""
    is_offset: bool = True
    """Whether joint angles are counted from the default posture."""


class ForeignRecord(msgspec.Struct, frozen=True, kw_only=True):
    """What an imported policy keeps of its description in its own metadata, for checks."""

    joints: tuple[str, ...]
    """The robot's names of its joints, in the order of its observation."""
    moved: tuple[str, ...]
    """The robot's names of the joints that actions move, in the order of its actions."""
    windows: tuple[Window, ...]


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
        damping = "the robot's"
        if self.damping is not None:
            damping = f"{_range(self.damping)} N·m·s/rad"
        values = {
            "joints": f"{len(self.joints)}: {', '.join(self.joints)}",
            "default_pos": f"{_range(self.default_pos)} rad",
            "action": f"{self.mode}, scale {_range(self.scale)} rad",
            "position_gain": gain,
            "damping": damping,
            "rate": f"{self.rate:g} Hz",
            "observation": " ".join(
                f"{term.name}[{term.size}{f' x {term.history}' * (term.history > 1)}]"
                for term in self.observation
            ),
        }
        return [(name, text, self.sources[name]) for name, text in values.items()]


def _range(values: Array) -> str:
    low, high = float(np.min(values)), float(np.max(values))
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"


def spread(values: Any, size: int, what: str) -> Array:
    """Return ``size`` finite numbers: those of a list of that length, or one number for all."""
    try:
        array = np.atleast_1d(np.asarray(values, dtype=float))
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{what} is {values!r:.60}, expected numbers") from None
    if array.shape not in ((1,), (size,)):
        raise ValueError(f"{what} has shape {array.shape}, expected ({size},)")
    if not np.isfinite(array).all():
        raise ValueError(f"{what} holds {array[~np.isfinite(array)][0]}, expected finite")
    return np.resize(array, size)


def check_terms(names: Sequence[str]) -> None:
    """Raise an error that names all terms that no robot measures, and unknown ones."""
    known = ", ".join(known[0] for quantity, known in NAMES.items() if quantity != COMMAND)
    problems = [
        f"observation '{name}' is the {IMMEASURABLE[name]}, which the robot does not measure: "
        "train a policy without it"
        if name in IMMEASURABLE
        else f"observation '{name}' is unknown, expected {known}, *_commands"
        for name in names
        if not _find_quantity(name)
    ]
    if problems:
        raise ValueError("; ".join(problems))


def find_size(name: str, joints: int, actions: int) -> int | None:
    """Return the size of a term; ``None`` for a command, whose size its name does not say."""
    quantity = _find_quantity(name)
    if quantity == COMMAND:
        return 3 if "velocity" in name or "vel" in name.split("_") else None
    return {"gyro": 3, "gravity": 3, "last_action": actions}.get(quantity, joints)


def _find_quantity(name: str) -> str:
    """Find the quantity of a term by its name; "" if it is not known."""
    # What a policy of motions tracks is no wish of a user.
    if name.endswith(("_command", "_commands")) and not name.startswith("motion"):
        return COMMAND
    return next((quantity for quantity, names in NAMES.items() if name in names), "")


def make_term(
    name: str,
    size: int,
    *,
    scale: Any = None,
    clip: Any = None,
    history: Any = None,
    is_offset: bool = True,
    label: str = "",
) -> ForeignTerm:
    """Make a term whose quantity its name tells; a label is what messages call it."""
    label = label or name
    owner = f"observation '{label}'"
    try:
        lower, upper = (-np.inf, np.inf) if clip is None else map(float, clip)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{owner}: clip is {clip!r:.40}, expected two numbers") from None
    if not lower < upper:
        raise ValueError(f"{owner}: clip is {lower:g} to {upper:g}, expected a range")
    return ForeignTerm(
        name=label,
        quantity=_find_quantity(name),
        size=size,
        history=read_history(history, owner),
        scale=spread(1.0 if scale is None else scale, size, f"{owner}: scale"),
        lower=lower,
        upper=upper,
        is_offset=is_offset,
    )


def read_history(steps: Any, owner: str) -> int:
    """Return the number of policy steps that a term holds: 1 or more."""
    if not isinstance(steps or 0, int | float) or not 0 <= (steps or 0) <= MOST_HISTORY:
        raise ValueError(f"{owner}: history is {steps!r:.40}, expected 0 to {MOST_HISTORY} steps")
    return max(int(steps or 0), 1)


def map_joints(
    names: Sequence[str], robot: Robot, renamed: Mapping[str, str] | None = None
) -> dict[str, int]:
    """Find the joints of a robot that names mean: the same ones, but for words for the sides.

    Names of the robot's joints by those elsewhere, ``renamed``, count more.
    """
    renamed, own = renamed or {}, robot.joint_names
    if strange := [name for name in renamed.values() if name not in own]:
        raise ValueError(
            f"--rename names {', '.join(strange)}, expected joints of robot '{robot.name}': "
            f"{', '.join(own)}"
        )
    known = {_simplify(name): name for name in own} | {(name,): name for name in own}
    found = {
        name: renamed.get(name) or known.get((name,)) or known.get(_simplify(name), "")
        for name in names
    }
    problems = []
    if lacking := [name for name, joint in found.items() if not joint]:
        problems.append(
            f"robot '{robot.name}' has no {', '.join(lacking)}, expected {', '.join(own)}; "
            "--rename THEIRS=OURS,... says which are the same"
        )
    joints = [joint for joint in found.values() if joint]
    if len(found) < len(names) or len(set(joints)) < len(joints):
        twice = sorted({joint for joint in joints if joints.count(joint) > 1})
        problems.append(f"two names mean one joint: {', '.join(twice or names)}")
    if problems:
        raise ValueError("; ".join(problems))
    return {name: own.index(joint) for name, joint in found.items()}


def _simplify(name: str) -> tuple[str, ...]:
    """Return the words of a name behind that of a model: lower case, sides as letters in front."""
    plain = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name.rpartition("/")[2]).lower()
    words = [SIDES.get(word, word) for word in re.split(r"[_\-. ]+", plain)]
    kept = [word for word in words if word not in EMPTY]
    return tuple(sorted(kept, key=lambda word: word not in SIDES.values()))
