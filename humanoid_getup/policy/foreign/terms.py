"""Names of observation terms in other projects, and what they mean."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from humanoid_getup.policy.foreign.description import (
    ForeignPolicyError,
    ForeignTerm,
    Quantity,
    spread,
)

NAMES = {
    Quantity.GYRO: ("base_ang_vel", "ang_vel", "gyro", "imu_ang_vel", "builtin_sensor"),
    Quantity.GRAVITY: ("projected_gravity", "gravity", "gravity_orientation"),
    Quantity.JOINT_POS: ("joint_pos_rel", "joint_pos", "dof_pos"),
    Quantity.JOINT_VEL: ("joint_vel_rel", "joint_vel", "dof_vel"),
    Quantity.LAST_ACTION: ("last_action", "actions", "action", "prev_actions", "previous_actions"),
}
COMMANDS = ("command", "commands", "generated_commands", "velocity_commands")
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


def find_quantity(name: str) -> Quantity | None:
    """Find the quantity of a term by its name; ``None`` if it is not known."""
    found = (quantity for quantity, names in NAMES.items() if name in names)
    is_command = name in COMMANDS or name.endswith(("_command", "_commands"))
    is_command &= not name.startswith("motion")  # what a policy tracks is no wish of a user
    return next(found, Quantity.COMMAND if is_command else None)


def find_term_problems(names: Sequence[str]) -> list[str]:
    """Report terms that no robot measures, and unknown ones."""
    problems = [
        f"observation '{name}' is the {IMMEASURABLE[name]}, which the robot does not measure: "
        "train a policy without it"
        for name in names
        if name in IMMEASURABLE
    ]
    known = ", ".join((*(names[0] for names in NAMES.values()), "*_commands"))
    return problems + [
        f"observation '{name}' is unknown, expected {known}"
        for name in names
        if name not in IMMEASURABLE and find_quantity(name) is None
    ]


def check_terms(names: Sequence[str]) -> None:
    """Refuse terms that cannot be observed.

    Raises:
        ForeignPolicyError: naming all of them.
    """
    if problems := find_term_problems(names):
        raise ForeignPolicyError(*problems)


def find_size(name: str, joints: int, actions: int) -> int | None:
    """Return the size of a term; ``None`` for a command, whose size its name does not say."""
    quantity = find_quantity(name)
    if quantity is Quantity.COMMAND:
        return 3 if "velocity" in name or "vel" in name.split("_") else None
    sizes = {Quantity.GYRO: 3, Quantity.GRAVITY: 3, Quantity.LAST_ACTION: actions}
    return sizes.get(quantity, joints) if quantity else None


def make_term(
    name: str,
    size: int,
    *,
    scale: Any = None,
    clip: Any = None,
    history: Any = 1,
    is_offset: bool = True,
    label: str | None = None,
) -> ForeignTerm:
    """Make a term whose quantity its name tells.

    Raises:
        ForeignPolicyError: if a value does not fit.
    """
    quantity = find_quantity(name)
    owner = f"observation '{label or name}'"
    if quantity is None:
        raise ForeignPolicyError(*find_term_problems([name]))
    lower, upper = _read_clip(clip, owner)
    if not isinstance(history, int) or not 0 <= history <= MOST_HISTORY:
        raise ForeignPolicyError(
            f"{owner}: history is {history!r:.40}, expected 0 to {MOST_HISTORY} steps"
        )
    return ForeignTerm(
        name=label or name,
        quantity=quantity,
        scale=spread(1.0 if scale is None else scale, size, f"{owner}: scale"),
        lower=lower,
        upper=upper,
        history=max(history, 1),
        is_offset=is_offset,
    )


def _read_clip(clip: Any, owner: str) -> tuple[float, float]:
    if clip is None:
        return -np.inf, np.inf
    try:
        lower, upper = map(float, clip)
    except (TypeError, ValueError, OverflowError):
        raise ForeignPolicyError(f"{owner}: clip is {clip!r:.40}, expected two numbers") from None
    if not lower < upper:
        raise ForeignPolicyError(f"{owner}: clip is {lower:g} to {upper:g}, expected a range")
    return lower, upper
