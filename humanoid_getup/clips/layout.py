"""The layout of a recording, measured from its body: unit, up axis, rest pose and sides."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import reduce

import numpy as np

from humanoid_getup.clips.clip import UNITS, Clip, ClipLayout
from humanoid_getup.clips.joint_names import OTHER_SIDE, SIDES, rename_joints
from humanoid_getup.clips.recording import Recording
from robots.quaternion import Array
from robots.storage.validation import reading

PERSON = (1.0, 2.2)  # m; the height of a person, which is in the range in one unit only
BODY_SHARE = 0.8  # of a person's height: legs and trunk, from ankles to neck
STANDS = 0.85  # cosine between up and legs and trunk
LEVEL = 0.2  # of legs and trunk: the range of the lowest point of a body on a floor
BETTER, CLEAR, MOSTLY = 0.5, 0.05, 0.9  # what makes another axis than that of the rest pose up
BACKWARD = -0.25  # cosine between forward and a foot that points backward
AXES = ("x", "y", "z", "-x", "-y", "-z")
COLUMNS = ((1, 2, 0), (0, 2, 1), (0, 1, 2)) * 2  # that become x, y, z if such an axis points up
SIGNS = ((1, 1, 1), (1, -1, 1), (1, 1, 1), (1, -1, -1), (1, 1, -1), (1, -1, -1))


def measure_layout(
    recording: Recording, unit: float | None, up: str | None, renames: Mapping[str, str]
) -> Clip:
    """Read a recording as a clip; None for what is to be measured, as in `read_clip`."""
    with reading(f"clip {recording.file}"):
        names = rename_joints(recording.joints, renames)
    joints = {new: recording.joints[old] for new, old in names.items()}
    rest, pose = {new: recording.rest[old] for new, old in names.items()}, "angles zero"
    body = _Body(replace(recording, joints=joints, rest=rest))
    unit, zero = unit or body.find_unit(), body.find_stand()
    up = up or body.find_up(zero)
    if not zero:
        frame, lean = body.find_straightest(up)
        rest = {name: rows[frame] for name, rows in joints.items()}
        pose = f"frame at {frame * recording.period:.2f} s (leans {lean:.0f}°)"
    rest = {name: unit * _turn(row, zero or up) for name, row in rest.items()}
    joints = {name: unit * _turn(rows, up) for name, rows in joints.items()}
    sides = "as named"
    if all(body.is_backward(rest, side) for side in SIDES):
        sides = "exchanged, as both feet point backward"
        rest, joints = (
            {OTHER_SIDE.get(name, name): rows for name, rows in place.items()}
            for place in (rest, joints)
        )
    layout = ClipLayout(unit_m=unit, up=up, rest_pose=pose, sides=sides)
    file, period = recording.file, recording.period
    return Clip(file=file, period=period, joints=joints, rest=rest, layout=layout)


def parse_unit(text: str) -> float:
    """Parse a unit of length: its name, or its length [m]."""
    try:
        length = UNITS[text] if text in UNITS else float(text)
    except ValueError:
        length = 0.0
    if not 1e-6 <= length <= 1e3:
        raise ValueError(f"unit is {text}, expected {', '.join(UNITS)} or its length in meters")
    return length


def _turn(rows: Array, up: str) -> Array:
    """Turn positions (..., 3) so that z becomes up."""
    return rows[..., COLUMNS[AXES.index(up)]] * SIGNS[AXES.index(up)]


class _Body:
    """Legs and trunk of a recording, which show its layout."""

    def __init__(self, recording: Recording) -> None:
        self._recording, legs = recording, []
        trunk = np.linalg.norm(self._ways(recording.rest)[2])
        for side in SIDES:
            parts = [part for part in ("hip", "knee", "ankle") if recording.has(f"{side} {part}")]
            points = [recording.rest[recording.find(f"{side} {part}")] for part in parts]
            legs.append(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
        self._lengths = np.array([*legs, trunk])
        if not (self._lengths > 0.0).all():
            raise ValueError(
                f"{self._place}: hips, feet and neck are in one place, expected a body"
            )

    def find_unit(self) -> float:
        """Return the unit of length in which the body is as tall as a person [m]."""
        height = float(self._lengths[1:].sum()) / BODY_SHARE
        stated = [self._recording.unit] if self._recording.unit else []
        for unit in (*stated, *UNITS.values()):
            if PERSON[0] <= height * unit <= PERSON[1]:
                return unit
        raise ValueError(
            f"{self._place}: its body is {height:.4g} units tall, expected {PERSON[0]:g} to "
            f"{PERSON[1]:g} m in {', '.join(UNITS)}; --unit gives its unit, or the unit's meters"
        )

    def find_stand(self) -> str | None:
        """Return the axis along which the body stands with all angles zero, if any."""
        upright = self._measure_upright(self._recording.rest)
        return AXES[int(upright.argmax())] if upright.max() >= STANDS else None

    def find_up(self, zero: str | None) -> str:
        """Return the axis that points up.

        It is the one along which the body stands with all angles zero, unless the frames contradict
        it: there is no floor along it, but along another one, along which the body stands. Without
        such a pose it is that with the most level floor of those along which it ever stands.
        """
        stands = self._measure_upright(self._recording.joints) >= STANDS  # (T, 6)
        floor, other = self._measure_floor(), np.any(stands, axis=0)
        if zero:
            own = AXES.index(zero)
            is_worse = (floor[own] > LEVEL) & (floor < BETTER * floor[own])
            if not other[own]:
                is_worse |= (stands.mean(axis=0) >= MOSTLY) & (floor < LEVEL)
            other &= is_worse
            if not other.any():
                return zero
        found = sorted(np.flatnonzero(other), key=lambda k: floor[k])
        found = [AXES[k] for k in found if floor[k] < floor[found[0]] + CLEAR]
        if len(found) != 1:
            raise ValueError(
                f"{self._place}: its body stands along {' or '.join(found) or 'no axis'}, expected "
                "one; --up gives the axis that points up"
            )
        return found[0]

    def find_straightest(self, up: str) -> tuple[int, float]:
        """Return the frame in which the body stands straightest, and how far it leans [deg]."""
        upright = self._measure_upright(self._recording.joints)[:, AXES.index(up)]
        frame = int(upright.argmax())
        lean = float(np.degrees(np.arccos(min(upright[frame], 1.0))))
        if upright[frame] < STANDS:
            raise ValueError(
                f"{self._place}: it stands neither with all angles zero nor in any frame (it leans "
                f"by {lean:.0f}° from {up}), expected a clip with a stand"
            )
        return frame, lean

    def is_backward(self, rest: Mapping[str, Array], side: str) -> bool:
        """Tell whether a foot points backward in a rest pose, z up; without toes it does not."""
        left, right, ankle = (self._at(rest, n) for n in ("left hip", "right hip", f"{side} ankle"))
        foot = forward = np.cross(left - right, [0.0, 0.0, 1.0])
        if self._recording.has(f"{side} toes"):
            foot = self._at(rest, f"{side} toes") - ankle
        return float(forward @ foot) < BACKWARD * float(
            np.linalg.norm(forward) * np.linalg.norm(foot)
        )

    @property
    def _place(self) -> str:
        return f"clip {self._recording.file}"

    def _at(self, pose: Mapping[str, Array], what: str) -> Array:
        return pose[self._recording.find(what)]

    def _ways(self, pose: Mapping[str, Array]) -> Array:
        """Return the ways from ankles to hips, and from these to the neck, (3, ..., 3)."""
        hips, ankles = (
            np.array([self._at(pose, f"{side} {part}") for side in SIDES])
            for part in ("hip", "ankle")
        )
        return np.array([*(hips - ankles), self._at(pose, "neck") - hips.mean(axis=0)])

    def _measure_upright(self, pose: Mapping[str, Array]) -> Array:
        """Return how far legs and trunk reach along each axis, 1 for a straight stand, (..., 6)."""
        ways = self._ways(pose)
        ways = ways / self._lengths.reshape(3, *(1,) * (ways.ndim - 1))
        return np.concatenate([ways, -ways], axis=-1).min(axis=0)

    def _measure_floor(self) -> Array:
        """Return the range of the lowest point along each axis, as share of the body, (6,)."""
        places = list(self._recording.joints.values())
        low, high = reduce(np.minimum, places), reduce(np.maximum, places)
        ends = np.percentile(np.concatenate([low, -high], axis=-1), [5.0, 95.0], axis=0)
        return (ends[1] - ends[0]) / self._lengths[1:].sum()
