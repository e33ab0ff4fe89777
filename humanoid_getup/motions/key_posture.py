"""Key postures: postures chosen by a user, from a file or from a motion."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from humanoid_getup.motions.motion_database import find_motion
from robots import Posture, Robot, load_posture

MOTIONS = "motions:"
EXAMPLE = "motions:supine_sit_up_gentle@1.2"


@dataclass(frozen=True, kw_only=True, eq=False)
class KeyPosture:
    """A posture with the name by which it was requested."""

    name: str
    posture: Posture


def name_keys(keys: Sequence[Posture | KeyPosture]) -> tuple[KeyPosture, ...]:
    """Give each posture without a name its number, from 1."""
    return tuple(
        key if isinstance(key, KeyPosture) else KeyPosture(name=f"key {number}", posture=key)
        for number, key in enumerate(keys, start=1)
    )


def load_key(text: str, robot: Robot) -> KeyPosture:
    """Load a posture file, or the frame of a motion that ``motions:NAME@TIME`` names.

    NAME is that of a motion in the robot's database or of an .npz file, TIME is counted from its
    first frame [s]; the nearest frame is taken.

    Raises:
        ValueError: if there is no such file, motion or time, or the posture does not fit the
            robot.
    """
    if text.startswith(MOTIONS):
        return KeyPosture(name=text, posture=_pick_frame(text, robot))
    path = Path(text)
    if not path.exists():
        raise ValueError(
            f"posture '{text}': no such file, expected a posture file or motions:NAME@TIME"
        )
    return KeyPosture(name=text, posture=load_posture(path, robot))


def _pick_frame(text: str, robot: Robot) -> Posture:
    name, _, at = text.removeprefix(MOTIONS).rpartition("@")
    try:
        time = float(at)
    except ValueError:
        time = math.nan
    if not name or not math.isfinite(time):
        raise ValueError(f"posture '{text}': expected motions:NAME@TIME, such as {EXAMPLE}")
    motion = find_motion(robot, name)
    if not 0.0 <= time <= motion.duration:
        raise ValueError(
            f"posture '{text}': its time is {time:g} s, expected 0 to {motion.duration:.2f} s"
        )
    return motion.posture(int(np.argmin(np.abs(motion.time - motion.time[0] - time))))
