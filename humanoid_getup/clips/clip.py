"""A clip of motion capture: positions of a body's joints over time, and the axes of its parts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from humanoid_getup.clips.joint_names import MIDDLE, SIDES, is_foot
from humanoid_getup.clips.recording import Recording
from robots.body.limbs import LIMB_NAMES, LimbName, LimbPose
from robots.quaternion import Array

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "inch": 0.0254}
"""Units of length [m]."""
SMALL = 1e-9
LEAST_SPINE = 0.05  # of the way from hips to neck: a spine joint that is nearer to one is none


@dataclass(frozen=True, kw_only=True)
class ClipLayout:
    """What was taken to read a file: measured from its body, or given."""

    unit_m: float
    """One unit of length [m]."""
    up: str
    """Axis that points up, such as y or -z."""
    rest_pose: str
    """Pose that is taken for a stand."""
    sides: str
    """What left and right are taken from."""

    def __str__(self) -> str:
        unit = next((n for n, m in UNITS.items() if m == self.unit_m), f"{self.unit_m:.4g} m")
        return f"unit {unit}, {self.up} up, rest pose: {self.rest_pose}, sides: {self.sides}"


@dataclass(frozen=True, kw_only=True, eq=False)
class Clip(Recording):
    """Joint positions [m] over time and in the rest pose, in which the body stands; z is up."""

    layout: ClipLayout | None = None
    """How its file was read."""

    @property
    def leg_length(self) -> float:
        """Return the distance from the hips to the lowest foot in the rest pose [m]."""
        left, right = (self.rest[self.find(f"{side} hip")] for side in SIDES)
        return float((0.5 * (left + right) - self.lowest_foot(self.rest))[2])

    def lowest_foot(self, pose: Mapping[str, Array]) -> Array:
        """Return the position of the lowest foot joint in a pose, (3,)."""
        return min((pose[name] for name in pose if is_foot(name)), key=lambda point: point[2])


@dataclass(frozen=True, eq=False)
class LimbTrack:
    """Directions of a limb in the world over time."""

    upper: Array
    """Unit vectors along upper arm or thigh, (T, 3)."""
    lower: Array
    """Unit vectors along forearm or shank, (T, 3)."""
    foot: Array | None
    """Forward, left and up of the foot, in columns, (T, 3, 3); None for an arm, or without toes."""

    def pose(self, frame: int, torso: Array) -> LimbPose:
        """Return the pose at a frame relative to the axes of a torso (3, 3)."""
        foot = None if self.foot is None else torso.T @ self.foot[frame]
        return LimbPose(torso.T @ self.upper[frame], torso.T @ self.lower[frame], foot)


@dataclass(frozen=True, eq=False, kw_only=True)
class ClipBody:
    """Axes and limbs of a clip's body in a world whose z axis points up."""

    hips: Array
    """Middle of the hips [m], (T, 3)."""
    pelvis: Array
    """Forward, left and up of the pelvis, in columns, (T, 3, 3)."""
    torso: Array
    """The same of the whole trunk, from the hips to the neck, (T, 3, 3)."""
    chest: Array
    """The same of the chest, from the middle of the spine to neck and shoulders, (T, 3, 3)."""
    limbs: dict[LimbName, LimbTrack]


def read_body(clip: Clip) -> ClipBody:
    """Find the body in a clip.

    The axes of pelvis, trunk and chest are those of the world where the body stands in the clip's
    rest pose.
    """
    places, rest = _Places(clip, is_rest=False), _Places(clip, is_rest=True)
    return ClipBody(
        hips=places.hips(),
        pelvis=_from_rest(places.pelvis(), rest.pelvis()),
        torso=_from_rest(places.torso(), rest.torso()),
        chest=_from_rest(places.chest(), rest.chest()),
        limbs={
            name: places.limb(name, rest)
            for name in LIMB_NAMES
            if "leg" in name or all(clip.has(f"{name[:-4]} {end}") for end in ("elbow", "wrist"))
        },
    )


class _Places:
    """Positions of a clip's joints, or of its rest pose as a single frame."""

    def __init__(self, clip: Clip, *, is_rest: bool) -> None:
        self._clip, self._is_rest = clip, is_rest

    def of(self, what: str) -> Array:
        """Return the positions of a joint, such as the "left hip", (T, 3)."""
        name = self._clip.find(what)
        return self._clip.rest[name][None] if self._is_rest else self._clip.joints[name]

    def hips(self) -> Array:
        """Return the middle of the hips, (T, 3)."""
        left, right = self._hip_ends()
        return 0.5 * (left + right)

    def pelvis(self) -> Array:
        """Return the axes of the hips and the spine above them, (T, 3, 3)."""
        left, right = self._hip_ends()
        return self._axes(left - right, self._spine() - self.hips(), "hips and spine")

    def torso(self) -> Array:
        """Return the axes of hips and neck, (T, 3, 3)."""
        left, right = self._hip_ends()
        return self._axes(left - right, self.of("neck") - self.hips(), "hips and neck")

    def chest(self) -> Array:
        """Return the axes of shoulders and neck, (T, 3, 3)."""
        across = self.of("left shoulder") - self.of("right shoulder")
        return self._axes(across, self.of("neck") - self._spine(), "shoulders and neck")

    def limb(self, name: LimbName, rest: _Places) -> LimbTrack:
        """Return the directions of a limb."""
        side, kind = name.split("_")
        parts = ("shoulder", "elbow", "wrist") if kind == "arm" else ("hip", "knee", "ankle")
        first, middle, end = (self.of(f"{side} {part}") for part in parts)
        upper = self._unit(middle - first, f"upper {name}")
        lower = self._unit(end - middle, f"lower {name}")
        return LimbTrack(upper, lower, self._foot(side, lower, rest) if kind == "leg" else None)

    def _foot(self, side: str, lower: Array, rest: _Places) -> Array | None:
        """Return the axes of a foot, level where it is in the rest pose, (T, 3, 3)."""
        if not self._clip.has(f"{side} toes"):
            return None
        forward, still = self._forward(side), rest._forward(side)[0]
        left = self._unit(np.cross(-lower, forward), f"{side} foot")
        up = np.cross(forward, left)
        slope = math.asin(float(np.clip(still[2], -1.0, 1.0)))  # of the way to the toes, at rest
        level = math.cos(slope) * forward - math.sin(slope) * up
        return np.stack([level, left, np.cross(level, left)], axis=-1)

    def _forward(self, side: str) -> Array:
        return self._unit(self.of(f"{side} toes") - self.of(f"{side} ankle"), f"{side} foot")

    def _hip_ends(self) -> tuple[Array, Array]:
        return self.of("left hip"), self.of("right hip")

    def _spine(self) -> Array:
        """Return a joint of the spine; without one, a place between hips and neck."""
        rest = _Places(self._clip, is_rest=True)
        ends = rest.hips(), rest.of("neck")
        for name in MIDDLE["spine"]:
            if name in self._clip.joints:
                away = [float(np.linalg.norm(self._clip.rest[name] - end)) for end in ends]
                if min(away) > LEAST_SPINE * sum(away):
                    return (self._clip.rest if self._is_rest else self._clip.joints)[name]
        return 0.5 * (self.hips() + self.of("neck"))

    def _axes(self, left: Array, up: Array, what: str) -> Array:
        """Return axes with their left along one vector and their up near another, (T, 3, 3)."""
        left = self._unit(left, what)
        forward = self._unit(np.cross(left, up), what)
        return np.stack([forward, left, np.cross(forward, left)], axis=-1)

    def _unit(self, rows: Array, what: str) -> Array:
        length = np.linalg.norm(rows, axis=-1)
        if length.min() <= SMALL:
            raise ValueError(
                f"clip {self._clip.file}: {what} are in one place or line in frame "
                f"{int(np.argmin(length)) + 1}, expected a body"
            )
        return rows / length[:, None]


def _from_rest(axes: Array, rest: Array) -> Array:
    """Turn axes (T, 3, 3) so that in the rest pose (1, 3, 3) they stand upright."""
    left = rest[0, :, 1] * [1.0, 1.0, 0.0]
    left = left / max(float(np.linalg.norm(left)), SMALL)
    up = np.array([0.0, 0.0, 1.0])
    upright = np.stack([np.cross(left, up), left, up], axis=-1)
    return axes @ rest[0].T @ upright
