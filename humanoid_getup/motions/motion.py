"""A rising motion: postures over time, and what the servos are sent."""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from robots import Posture, Robot, quaternion
from robots.arrays import NUMBERS, load_arrays, save_arrays, to_text
from robots.posture import UNIT_TOLERANCE
from robots.quaternion import Array

Bools = NDArray[np.bool_]
StartClass = Literal["supine", "prone", "left", "right", "squat"]
START_CLASSES: tuple[StartClass, ...] = get_args(StartClass)
MIRRORED_CLASS: dict[StartClass, StartClass] = {"left": "right", "right": "left"}
MIRRORED_SUFFIX = "_mirrored"

TEXTS = ("name", "robot", "start_class", "strategy", "provenance")
ARRAYS = ("time", "position", "orientation", "joint_pos", "joint_target", "entry")
KEYS = TEXTS + ARRAYS
"""Keys of a motion file, as the fields of `Motion`; provenance is JSON text."""


@dataclass(frozen=True, kw_only=True)
class Motion:
    """Postures over time, ready to be played."""

    name: str
    robot: str
    """Name of the robot it was made for."""
    start_class: StartClass
    strategy: str
    """How it rises, in biomechanics' terms, e.g. "sit-up"."""
    time: Array
    """Sample times from the start [s], shape (T,), strictly increasing."""
    position: Array
    """Root position in the world [m], shape (T, 3)."""
    orientation: Array
    """Root orientation in the world, unit quaternions w x y z, shape (T, 4)."""
    joint_pos: Array
    """Angles that the joints go through [rad], shape (T, n), in the robot's joint order."""
    joint_target: Array
    """Angles that the servos are sent [rad], shape (T, n).

    They differ from ``joint_pos`` by what loads the joints: a position servo
    makes its torque from the difference.
    """
    entry: Bools = field(default_factory=lambda: np.zeros(0, dtype=bool))
    """Frames from which the rest, started at rest there, still ends standing, (T,).

    Left out or all False means frame 0 alone.
    """
    provenance: dict[str, str | float | int] = field(default_factory=dict)
    """Where it comes from: program, seed, cost..."""

    def __post_init__(self) -> None:
        if not np.any(self.entry):
            object.__setattr__(self, "entry", np.arange(len(self.time)) == 0)
        faults = self._find_faults()
        if faults:
            raise ValueError(f"motion '{self.name}': " + "; ".join(faults))

    def _find_faults(self) -> list[str]:
        if self.start_class not in START_CLASSES:
            return [f"start_class is '{self.start_class}', expected {', '.join(START_CLASSES)}"]
        faults = _shape_faults(self)
        if faults:
            return faults
        for key in ("time", "position", "orientation", "joint_pos", "joint_target"):
            if not np.all(np.isfinite(getattr(self, key))):
                faults.append(f"{key} holds {_first_odd(getattr(self, key))}, expected finite")
        if faults:
            return faults
        if np.any(np.diff(self.time) <= 0.0):
            frame = int(np.argmax(np.diff(self.time) <= 0.0))
            faults.append(f"time must be strictly increasing, it is not after frame {frame}")
        length = np.linalg.norm(self.orientation, axis=1)
        worst = int(np.argmax(np.abs(length - 1.0)))
        if abs(length[worst] - 1.0) > UNIT_TOLERANCE:
            faults.append(
                f"orientation of frame {worst} has length {length[worst]:.4f}, expected 1"
            )
        return faults

    @property
    def duration(self) -> float:
        """Return the time from the first to the last frame [s]."""
        return float(self.time[-1] - self.time[0])

    @property
    def entry_frames(self) -> NDArray[np.intp]:
        """Return the frames at which the motion may be entered."""
        return np.flatnonzero(self.entry)

    def posture(self, frame: int) -> Posture:
        """Return the posture at a frame."""
        return Posture(
            position=self.position[frame],
            orientation=self.orientation[frame],
            joint_pos=self.joint_pos[frame],
        )

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
        name = self.name
        return replace(
            self,
            name=name.removesuffix(MIRRORED_SUFFIX)
            if name.endswith(MIRRORED_SUFFIX)
            else name + MIRRORED_SUFFIX,
            start_class=MIRRORED_CLASS.get(self.start_class, self.start_class),
            position=self.position * np.array([1.0, -1.0, 1.0]),
            orientation=quaternion.mirror(self.orientation),
            joint_pos=robot.mirror_joints(self.joint_pos),
            joint_target=robot.mirror_joints(self.joint_target),
        )

    def save(self, path: Path) -> None:
        """Write the motion as .npz with the keys of `KEYS`."""
        record: dict[str, Any] = {key: getattr(self, key) for key in KEYS}
        save_arrays(path, record | {"provenance": json.dumps(self.provenance, sort_keys=True)})

    def save_csv(self, path: Path, robot: Robot) -> None:
        """Write time, root, joint angles and servo targets as columns with a header."""
        root = ["time", "x", "y", "z", "qw", "qx", "qy", "qz"]
        names = [*root, *robot.joint_names, *(f"{name}_target" for name in robot.joint_names)]
        columns = [self.time[:, None], self.position, self.orientation]
        table = np.hstack([*columns, self.joint_pos, self.joint_target])
        np.savetxt(path, table, fmt="%.6f", delimiter=",", header=",".join(names), comments="")

    @classmethod
    def load(cls, path: Path) -> Motion:
        """Load a motion file.

        Raises:
            ValueError: one line that names the file, what is wrong and what is expected.
        """
        try:
            return cls(**_read(path))
        except OSError as error:
            raise ValueError(f"motion file {path}: {error.strerror or error}") from error
        except (ValueError, RecursionError) as error:
            reason = str(error).splitlines()[0]
            raise ValueError(
                f"motion file {path}: {reason} (expected: an .npz as `Motion.save` writes it)"
            ) from error


def _read(path: Path) -> dict[str, Any]:
    record: dict[str, Any] = load_arrays(path, KEYS)
    record |= {key: to_text(record[key], key) for key in TEXTS}
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


def _shape_faults(motion: Motion) -> list[str]:
    if motion.time.ndim != 1 or motion.time.size == 0:
        return [f"time has shape {motion.time.shape}, expected (T,) with T > 0"]
    frames = len(motion.time)
    n = motion.joint_pos.shape[-1] if motion.joint_pos.ndim else 0
    allowed = {
        "position": (frames, 3),
        "orientation": (frames, 4),
        "joint_pos": (frames, n),
        "joint_target": (frames, n),
        "entry": (frames,),
    }
    return [
        f"{key} has shape {getattr(motion, key).shape}, expected {shape}"
        for key, shape in allowed.items()
        if getattr(motion, key).shape != shape
    ]


def _first_odd(values: Array) -> str:
    index = np.argwhere(~np.isfinite(values))[0]
    return f"{values[tuple(index)]} at {index.tolist()}"


BLEND = 0.32  # s in which the motion's load on the servos comes in


def join(motion: Motion, frame: int, joint_pos: Array, period: float) -> Array:
    """Compute the targets that take a motion up at a frame, (T, n).

    What the motion's targets lead the joint angles ``joint_pos`` by at first, which is
    the load on the servos there, comes in smoothly.
    """
    time = np.arange(motion.time[frame], motion.time[-1] + 0.5 * period, period)
    share = np.clip((time - time[0]) / BLEND, 0.0, 1.0)[:, None]
    share = share * share * (3.0 - 2.0 * share)
    return motion.sample(time) - (1.0 - share) * (motion.joint_target[frame] - joint_pos)
