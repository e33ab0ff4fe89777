"""A motion: postures over time, and the targets of the servos; it rises, or lies down."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from robots import Posture, Robot, quaternion
from robots.arguments import expect
from robots.posture import MAX_DISTANCE, UNIT_TOLERANCE
from robots.quaternion import Array
from robots.storage.arrays import NUMBERS, load_arrays, save_arrays, to_text

Bools = NDArray[np.bool_]
StartClass = Literal["supine", "prone", "left", "right", "squat", "standing"]
START_CLASSES: tuple[StartClass, ...] = get_args(StartClass)
EndClass = Literal["supine", "prone", "left", "right", "standing"]
STANDING = "standing"
FOUND = "found"
"""Strategy of a motion that was found in physics, and name of one that is not stored."""
CAPTURED = "motion capture"
"""Strategy of a motion of a person."""
NO_END = "other"
END_CLASSES: tuple[str, ...] = (*get_args(EndClass), NO_END)
MIRRORED_CLASS: dict[str, Literal["left", "right"]] = {"left": "right", "right": "left"}
NAME = re.compile(r"[\w-][\w.-]{0,99}")
"""Names of motions: they name files too."""
MIRRORED_SUFFIX = "_mirrored"
MAX_DURATION = 120.0  # s; the slowest rise takes 8

TEXTS = ("name", "robot", "start_class", "strategy", "provenance")
ARRAYS = ("time", "position", "orientation", "joint_pos", "joint_target", "entry")
KEYS = TEXTS + ARRAYS
"""Keys of a motion file, as the fields of `Motion`; provenance is JSON text."""
OPTIONAL_KEYS = ("end_class",)
"""Keys that a file may lack; a motion ends standing then."""


@dataclass(frozen=True, kw_only=True)
class Trajectory:
    """Postures over time."""

    time: Array
    """Sample times from the start [s], shape (T,), strictly increasing."""
    position: Array
    """Root position in the world [m], shape (T, 3)."""
    orientation: Array
    """Root orientation in the world, unit quaternions w x y z, shape (T, 4)."""
    joint_pos: Array
    """Joint angles [rad], shape (T, n), in the robot's joint order."""

    def posture(self, frame: int) -> Posture:
        """Return the posture at a frame."""
        return Posture(
            position=self.position[frame],
            orientation=self.orientation[frame],
            joint_pos=self.joint_pos[frame],
        )


@dataclass(frozen=True, kw_only=True)
class Motion(Trajectory):
    """Postures over time, ready to be played."""

    name: str
    robot: str
    """Name of the robot it was made for."""
    start_class: StartClass
    strategy: str
    """Kind of motion in terms of biomechanics, such as "sit-up"."""
    joint_target: Array
    """Target angles of the servos [rad], shape (T, n). They differ from ``joint_pos`` by the
    load on the joints: a position servo produces its torque from the difference."""
    end_class: EndClass | Literal["other"] = STANDING
    """What it ends in: a held stand, or the side on which the robot lies; "other" for a motion
    that is to be continued, such as a path to the beginning of another one."""
    entry: Bools = field(default_factory=lambda: np.zeros(0, dtype=bool))
    """Frames at which the motion may be entered at rest and still ends standing, (T,);
    empty or all False for frame 0 alone."""
    provenance: dict[str, str | float | int] = field(default_factory=dict)
    """How it was made: program, seed, cost..."""

    def __post_init__(self) -> None:
        if not np.any(self.entry):
            object.__setattr__(self, "entry", np.arange(len(self.time)) == 0)
        if not NAME.fullmatch(self.name):
            raise ValueError(
                f"motion name {self.name!r}: expected 1 to 100 letters, digits, '_', '-' or '.', "
                "not '.' first"
            )
        problems = _check_shapes(self) or _check_finite(self) or _check_values(self)
        if problems:
            raise ValueError(f"motion '{self.name}': " + "; ".join(problems))

    def __repr__(self) -> str:
        return (
            f"Motion({self.name} of {self.robot}: {self.start_class} to {self.end_class}, "
            f"{self.duration:.2f} s, {len(self.time)} frames of {self.joint_pos.shape[1]} joints)"
        )

    @property
    def duration(self) -> float:
        """Return the time from the first to the last frame [s]."""
        return float(self.time[-1] - self.time[0])

    @property
    def rises(self) -> bool:
        """Return whether the motion ends standing."""
        return self.end_class == STANDING

    @property
    def entry_frames(self) -> NDArray[np.intp]:
        """Return the frames at which the motion may be entered."""
        return np.flatnonzero(self.entry)

    @classmethod
    def through(cls, postures: Sequence[Posture], period: float, **fields: Any) -> Motion:
        """Make the motion through postures that are a period [s] apart."""
        return cls(
            time=np.arange(len(postures), dtype=float) * period,
            position=np.array([p.position for p in postures]),
            orientation=np.array([p.orientation for p in postures]),
            joint_pos=np.array([p.joint_pos for p in postures]),
            **fields,
        )

    @property
    def stand_time(self) -> float | None:
        """Return the time of the stand in the recording [s]; ``None`` if unknown."""
        stated = self.provenance.get("stand_time_s")
        if not isinstance(stated, (int, float)) or not 0.0 < stated <= MAX_DURATION:
            return None
        return float(stated)

    def sample(self, time: Array | float) -> Array:
        """Interpolate the servo targets [rad] at times (...) [s] linearly, (..., n).

        Before the start and after the end they hold still.
        """
        time = np.clip(time, self.time[0], self.time[-1])
        after = np.clip(np.searchsorted(self.time, time), 1, len(self.time) - 1)
        if len(self.time) == 1:
            return np.broadcast_to(self.joint_target[0], (*time.shape, self.joint_target.shape[1]))
        share = (time - self.time[after - 1]) / (self.time[after] - self.time[after - 1])
        before, target = self.joint_target[after - 1], self.joint_target[after]
        return before + share[..., None] * (target - before)

    def mirrored(self, robot: Robot) -> Motion:
        """Exchange left and right."""
        original = self.name.removesuffix(MIRRORED_SUFFIX)
        return replace(
            self,
            name=original if original != self.name else self.name + MIRRORED_SUFFIX,
            start_class=MIRRORED_CLASS.get(self.start_class, self.start_class),
            end_class=MIRRORED_CLASS.get(self.end_class, self.end_class),
            position=self.position * np.array([1.0, -1.0, 1.0]),
            orientation=quaternion.mirror(self.orientation),
            joint_pos=robot.mirror_joints(self.joint_pos),
            joint_target=robot.mirror_joints(self.joint_target),
        )

    def save(self, path: Path) -> None:
        """Write the motion as .npz with the keys of `KEYS` and `OPTIONAL_KEYS`."""
        record: dict[str, object] = {key: getattr(self, key) for key in KEYS + OPTIONAL_KEYS}
        save_arrays(path, record | {"provenance": json.dumps(self.provenance, sort_keys=True)})

    @classmethod
    def load(cls, path: Path | str) -> Motion:
        """Load a motion file.

        Raises:
            ValueError: one line that names the file, what is wrong and what is expected.
        """
        expect("path", path, str | Path, "a motion file")
        try:
            return cls(**_read(Path(path)))
        except OSError as error:
            raise ValueError(f"motion file {path}: {error.strerror or error}") from error
        except (ValueError, RecursionError) as error:
            reason = str(error).splitlines()[0]
            raise ValueError(
                f"motion file {path}: {reason} (expected: an .npz as `Motion.save` writes it)"
            ) from error


def _read(path: Path) -> dict[str, Any]:
    record: dict[str, Any] = load_arrays(path, KEYS, optional=OPTIONAL_KEYS)
    texts = (key for key in TEXTS + OPTIONAL_KEYS if key in record)
    record |= {key: to_text(record[key], key) for key in texts}
    record["provenance"] = json.loads(record["provenance"])
    if not isinstance(record["provenance"], dict) or not all(
        isinstance(value, str | int | float) for value in record["provenance"].values()
    ):
        raise ValueError("provenance is not an object of texts and numbers")
    for key in ARRAYS:
        if record[key].dtype.kind not in NUMBERS:
            raise ValueError(f"{key} is not an array of numbers")
        record[key] = record[key].astype(bool if key == "entry" else float)
    return record


def _check_shapes(motion: Motion) -> list[str]:
    if motion.start_class not in START_CLASSES:
        return [f"start_class is '{motion.start_class}', expected {', '.join(START_CLASSES)}"]
    if motion.end_class not in END_CLASSES:
        return [f"end_class is '{motion.end_class}', expected {', '.join(END_CLASSES)}"]
    if motion.time.ndim != 1 or motion.time.size == 0:
        return [f"time has shape {motion.time.shape}, expected (T,) with T > 0"]
    frames = len(motion.time)
    n = motion.joint_pos.shape[-1] if motion.joint_pos.ndim else 0
    expected = {
        "position": (frames, 3),
        "orientation": (frames, 4),
        "joint_pos": (frames, n),
        "joint_target": (frames, n),
        "entry": (frames,),
    }
    return [
        f"{key} has shape {getattr(motion, key).shape}, expected {shape}"
        for key, shape in expected.items()
        if getattr(motion, key).shape != shape
    ]


def _check_finite(motion: Motion) -> list[str]:
    problems = []
    for key in ("time", "position", "orientation", "joint_pos", "joint_target"):
        values: Array = getattr(motion, key)
        for index in np.argwhere(~np.isfinite(values))[:1]:
            found = f"{values[tuple(index)]} at {index.tolist()}"
            problems.append(f"{key} holds {found}, expected finite")
    return problems


def _check_values(motion: Motion) -> list[str]:
    problems = []
    if np.any(np.diff(motion.time) <= 0.0):
        frame = int(np.argmax(np.diff(motion.time) <= 0.0))
        problems.append(f"time must be strictly increasing, it is not after frame {frame}")
    length = np.linalg.norm(motion.orientation, axis=1)
    worst = int(np.argmax(np.abs(length - 1.0)))
    if abs(length[worst] - 1.0) > UNIT_TOLERANCE:
        problems.append(f"orientation of frame {worst} has length {length[worst]:.4f}, expected 1")
    duration = motion.time[-1] - motion.time[0]
    if duration > MAX_DURATION:
        problems.append(f"it lasts {duration:.4g} s, expected at most {MAX_DURATION:g} s")
    farthest = float(np.abs(motion.position).max())
    if farthest > MAX_DISTANCE:
        problems.append(
            f"position is {farthest:.4g} m from the origin, expected at most {MAX_DISTANCE:g} m"
        )
    return problems


def hold_last(rows: Array, length: int) -> Array:
    """Repeat the last row up to a length."""
    return np.concatenate([rows, np.repeat(rows[-1:], length - len(rows), axis=0)])
