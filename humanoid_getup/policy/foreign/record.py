"""What an imported policy keeps of its description in its own metadata, for checks."""

from __future__ import annotations

import msgspec

from humanoid_getup.policy.foreign.description import ForeignPolicyError
from humanoid_getup.policy.foreign.wrapping import Wrapping

FOREIGN_KEY = "foreign_policy"  # in the metadata of an imported policy


class Window(msgspec.Struct, frozen=True, kw_only=True):
    """A part of the observation of an imported policy."""

    name: str
    quantity: str
    size: int
    history: int

    @property
    def length(self) -> int:
        """Return how many numbers it holds."""
        return self.size * self.history


class ForeignRecord(msgspec.Struct, frozen=True, kw_only=True):
    """Layout of the observation of an imported policy, and the damping of its training."""

    format: str
    joints: tuple[str, ...]
    """The robot's names of its joints, in the order of its observation."""
    moved: tuple[str, ...]
    """The robot's names of the joints that actions move, in the order of its actions."""
    windows: tuple[Window, ...]
    """Terms of its observation, in order."""
    scale: tuple[float, ...] = ()
    """Changes of targets by an action of 1 [rad], in the order of ``moved``."""
    damping: tuple[float, ...] = ()
    """Gains kd of its training [N·m·s/rad], in the order of ``joints``; () if not known."""

    @property
    def observation_size(self) -> int:
        """Return the size of its observation."""
        return sum(window.length for window in self.windows)


def to_record(wrapping: Wrapping) -> str:
    """Write what the checks of an imported policy need, as JSON."""
    policy, names = wrapping.policy, wrapping.robot.joint_names
    windows = [
        Window(name=term.name, quantity=term.quantity, size=term.size, history=term.history)
        for term in policy.observation
    ]
    record = ForeignRecord(
        format=policy.format,
        joints=tuple(names[wrapping.places[name]] for name in policy.joints),
        moved=tuple(names[wrapping.places[name]] for name in policy.moved),
        windows=tuple(windows),
        scale=tuple(policy.scale.tolist()),
        damping=() if policy.damping is None else tuple(policy.damping.tolist()),
    )
    return msgspec.json.encode(record).decode()


def from_record(text: str) -> ForeignRecord:
    """Read what `to_record` wrote.

    Raises:
        ForeignPolicyError: if it is something else.
    """
    try:
        return msgspec.json.decode(text, type=ForeignRecord)
    except msgspec.MsgspecError as error:
        raise ForeignPolicyError(f"its metadata '{FOREIGN_KEY}' is malformed: {error}") from error
