"""Extraction of style curves from recorded features, motions and simulated rises."""

from __future__ import annotations

import mujoco
import numpy as np

from humanoid_getup.clips.clip import LEFT_HIPS, NECKS, RIGHT_HIPS, UP, Clip, is_foot
from humanoid_getup.scenes.ground import FLAT, Ground, mean_height
from humanoid_getup.style.curves import LEAST_END, PLACES, ROUNDING, StyleCurves
from humanoid_getup.style.features import AROUND, COUNT, angle_distance, torso_angles
from robots import Robot, quaternion
from robots.kinematics import site_positions
from robots.quaternion import Array

# A body that differs less than this from its first or last sample has not begun or has ended.
STILL_HEIGHT = 0.03  # share of the standing neck height
STILL_ANGLE = np.radians(5.0)
FLOOR_PERCENTILE = 5.0  # of the lowest foot's height over a clip: where the floor is


class ExtractionError(ValueError):
    """A record does not hold a rise; the message gives the reason."""


def compute_features(robot: Robot, neck: Array, orientation: Array, ground: Ground) -> Array:
    """Compute style features (T, 3) from neck positions [m], (T, 3), and orientations, (T, 4)."""
    size = robot.standing_neck_height
    height = (neck[:, 2] - mean_height(ground, neck[:, 0], neck[:, 1], AROUND * size)) / size
    angles = torso_angles(quaternion.gravity_in_body(orientation))
    return np.concatenate([height[:, None], angles], axis=-1)


def measure_features(
    robot: Robot, model: mujoco.MjModel, qpos: Array, ground: Ground = FLAT
) -> Array:
    """Measure style features (T, 3) of a robot at MuJoCo positions (T, nq)."""
    neck = site_positions(model, qpos, robot.neck_site)
    return compute_features(robot, neck, qpos[:, robot.layout(model).root_orientation], ground)


def measure_clip(clip: Clip) -> Array:
    """Measure style features (T, 3) of the body in a clip.

    The height is that of the neck's base over the floor, as a share of that in the rest pose.
    Front and side are those of [Frezzato22], figure 4, from hips and neck.

    Raises:
        ValueError: if it has no feet, hips or neck, or these are no torso.
    """
    axis, neck_name = UP[clip.up], clip.find(NECKS, "neck")
    left = clip.joints[clip.find(LEFT_HIPS, "left hip")]
    right = clip.joints[clip.find(RIGHT_HIPS, "right hip")]
    neck, side = clip.joints[neck_name], right - left
    front = np.cross(neck - 0.5 * (left + right), side)
    standing = float(clip.rest[neck_name][axis] - clip.lowest_foot(clip.rest)[axis])
    clip.check_height("the neck", standing * clip.unit)
    feet = [path for name, path in clip.joints.items() if is_foot(name)]
    floor = np.percentile(np.min([path[:, axis] for path in feet], axis=0), FLOOR_PERCENTILE)
    features = np.empty((len(neck), COUNT))
    features[:, 0] = (neck[:, axis] - floor) / standing
    for column, vector in ((1, side), (2, front)):
        length = np.linalg.norm(vector, axis=1)
        if not length.all():
            raise ValueError(
                f"clip {clip.file}: hips and neck are in one line or one place in frame "
                f"{int(np.argmin(length)) + 1}, expected a torso"
            )
        features[:, column] = np.arccos(np.clip(vector[:, axis] / length, -1.0, 1.0))
    return features


def trim(features: Array) -> slice:
    """Find the samples of features (T, 3) from the first to the last movement."""
    moved = _differs(features, features[0])
    unfinished = _differs(features, features[-1])
    if not moved.any():
        raise ExtractionError("nothing moves in what is extracted, expected a rise")
    first = max(int(np.argmax(moved)) - 1, 0)
    last = len(features) - 1 - int(np.argmax(unfinished[::-1])) + 1
    return slice(first, min(last, len(features) - 1) + 1)


def extract_curves(time: Array, features: Array) -> StyleCurves:
    """Make curves through nine equally spaced samples of features (T, 3) at times (T,) [s].

    Raises:
        ExtractionError: if they do not end standing.
    """
    if features.shape != (len(time), COUNT):
        raise ExtractionError(f"features have shape {features.shape}, expected ({len(time)}, 3)")
    if features[-1, 0] < LEAST_END - ROUNDING:
        raise ExtractionError(
            f"the neck ends at {features[-1, 0]:.2f} of its standing height, expected "
            f"{LEAST_END:g} or more"
        )
    share = (time - time[0]) / (time[-1] - time[0])
    points = [np.interp(PLACES, share, column) for column in features.T]
    try:
        return StyleCurves.of(np.stack(points, axis=-1), float(time[-1] - time[0]))
    except ValueError as error:
        raise ExtractionError(str(error)) from error


def _differs(features: Array, still: Array) -> Array:
    is_higher = np.abs(features[:, 0] - still[0]) > STILL_HEIGHT
    return is_higher | (angle_distance(features, still) > STILL_ANGLE)
