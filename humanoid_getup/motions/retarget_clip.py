"""Retargeting of clips: joint angles that point a robot's limbs as the clip's."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.spatial.transform import Rotation, Slerp

from humanoid_getup.clips.clip import Clip, ClipBody, ClipLayout, read_body
from humanoid_getup.experiments.falls import classify
from humanoid_getup.motions.keyframes import SPEED_SHARE
from humanoid_getup.motions.motion import (
    CAPTURED,
    MAX_DURATION,
    NO_END,
    STANDING,
    Motion,
    StartClass,
    Trajectory,
)
from robots import Robot, quaternion
from robots.body.limb_solver import LimbSolver, Trunk
from robots.body.limbs import LimbName, LimbPose, Limbs
from robots.body.parts import leg_length
from robots.kinematics import lowest_points, place_postures
from robots.quaternion import Array

Frames = NDArray[np.intp]
SOLVE_PERIOD = 0.04  # s between the frames that are solved; angles between them are interpolated
ON_LIMIT = math.radians(0.2)  # so near to the end of its range a joint is bound by it
BOUND_SHARE = 0.02  # of the frames, from which on that is reported
FINISH_TIME = 1.0  # s in which the body of [Frezzato22] steps from its last posture to the stance
TALL = 1.46  # m, its neck's height; times grow with the square root of the height
UPRIGHT = math.radians(45.0)  # tilt below which a robot that lies on no side stands or squats
STANDING_HEIGHT = 0.9  # share of the standing height of the hips, from which it stands


@dataclass(frozen=True, eq=False, kw_only=True)
class RetargetedClip:
    """A clip as a motion of a robot, and how far the limbs deviate from those of the clip."""

    motion: Motion
    slowdown: float
    """Duration over that of the clip on a body of the robot's size: above 1 where joints would
    have been too fast."""
    angle: dict[LimbName, Array]
    """Angle between the directions of the upper and of the lower limb [rad], (T, 2)."""
    limbs: dict[LimbName, Array]
    """Directions of the clip's upper and lower limbs in the torso's frame, (T, 2, 3)."""
    bound: dict[str, float]
    """Joints that are at an end of their range, and the share of the frames."""
    layout: ClipLayout | None = None
    """How the clip's file was read."""

    @property
    def mean_angle(self) -> float:
        """Return the mean angle [rad]."""
        return float(np.mean([rows.mean() for rows in self.angle.values()]))

    @property
    def largest_angle(self) -> tuple[LimbName, float]:
        """Return the limb that deviates most, and by how much [rad]."""
        return max(((n, float(rows.max())) for n, rows in self.angle.items()), key=lambda p: p[1])


class ClipRetargeter:
    """Retargets clips to one robot.

    The root turns as the pelvis of the body, or as its trunk where the robot has a stiff one; the
    joints of a trunk turn the chest; those of the limbs point them as the body's point in the
    frame of the torso. What no limb or trunk holds, such as a head, stays in the stance. The root
    moves over the ground as the hips do, in proportion to the legs, and is as high as the lowest
    point needs to touch the ground. Times grow with the square root of the legs' length, as those
    of a pendulum do, and where a servo would be too fast.
    """

    def __init__(self, robot: Robot) -> None:
        self.robot, self._limbs, self._trunk = robot, Limbs(robot), Trunk(robot)

    def retarget(
        self,
        clip: Clip,
        *,
        name: str,
        begin: float = 0.0,
        end: float = math.inf,
        finish: bool = False,
        report: Callable[[float], None] = lambda _: None,
    ) -> RetargetedClip:
        """Retarget the part of a clip between two times [s].

        With ``finish`` the motion ends in the robot's stance. The finished share is reported.
        """
        body, rows = read_body(clip), _choose_frames(clip, begin, end)
        angles = self._solve(body, rows, report)
        poses = self._pose(clip, body, rows, angles)
        if finish:
            poses = self._finish(poses)
        paced, slowdown = self._pace(poses)
        motion = self._make_motion(paced, name, clip, clip.time[rows], is_finished=finish)
        near = np.minimum(angles - self.robot.lower, self.robot.upper - angles) < ON_LIMIT
        limbs = self._read_limbs(body, rows)
        share = zip(self.robot.joint_names, near.mean(axis=0).tolist(), strict=True)
        return RetargetedClip(
            motion=motion,
            slowdown=slowdown,
            angle=self._measure(limbs, angles),
            limbs=limbs,
            bound={joint: part for joint, part in share if part >= BOUND_SHARE},
            layout=clip.layout,
        )

    def _solve(self, body: ClipBody, rows: Frames, report: Callable[[float], None]) -> Array:
        """Find the joint angles at frames of the clip, (T, n)."""
        angles, before = [], self.robot.standing.joint_pos
        for count, row in enumerate(rows):
            torso = self._torso(body)[row]
            if not self._trunk.is_stiff:
                before = self._trunk.solve(torso.T @ body.chest[row], before)
            poses: dict[LimbName, LimbPose] = {
                name: track.pose(row, torso) for name, track in body.limbs.items()
            }
            before = LimbSolver(self._limbs).solve(poses, before, is_near=count > 0)
            angles.append(before)
            report((count + 1) / len(rows))
        return np.array(angles)

    def _torso(self, body: ClipBody) -> Array:
        return body.torso if self._trunk.is_stiff else body.pelvis

    def _read_limbs(self, body: ClipBody, rows: Frames) -> dict[LimbName, Array]:
        """Read the directions of the limbs that body and robot have, (T, 2, 3) of each."""
        torso = self._torso(body)
        poses: dict[LimbName, list[LimbPose]] = {
            name: [track.pose(row, torso[row]) for row in rows]
            for name, track in body.limbs.items()
            if name in self._limbs.all
        }
        return {name: np.array([[p.upper, p.lower] for p in poses[name]]) for name in poses}

    def _measure(self, limbs: dict[LimbName, Array], angles: Array) -> dict[LimbName, Array]:
        """Measure the angles between the limbs of body and robot [rad], (T, 2) of each."""
        found = [self._limbs.measure(row) for row in angles]
        return {
            name: np.array(
                [
                    [_angle(upper, pose[name].upper), _angle(lower, pose[name].lower)]
                    for (upper, lower), pose in zip(wanted, found, strict=True)
                ]
            )
            for name, wanted in limbs.items()
        }

    def _pose(self, clip: Clip, body: ClipBody, rows: Frames, angles: Array) -> Trajectory:
        size = leg_length(self.robot) / clip.leg_length
        orientation = Rotation.from_matrix(self._torso(body)[rows]).as_quat(scalar_first=True)
        position = size * (body.hips[rows] - body.hips[rows[0]])
        position[:, 2] = 0.0
        time = (clip.time[rows] - clip.time[rows[0]]) * math.sqrt(size)
        return self._ground(
            Trajectory(time=time, position=position, orientation=orientation, joint_pos=angles)
        )

    def _ground(self, poses: Trajectory) -> Trajectory:
        """Raise or lower the root until the lowest point touches the ground."""
        model = self.robot.spec().compile()
        position = poses.position.copy()
        qpos = place_postures(self.robot, model, position, poses.orientation, poses.joint_pos)
        position[:, 2] -= lowest_points(model, qpos)
        return replace(poses, position=position)

    def _finish(self, poses: Trajectory) -> Trajectory:
        """Add the stance, upright and with the heading of the end."""
        robot, last = self.robot, poses.orientation[-1]
        ahead = quaternion.rotate(last, np.array([1.0, 0.0, 0.0]))
        heading = quaternion.from_yaw(math.atan2(ahead[1], ahead[0]))
        stance = quaternion.multiply(heading, robot.standing.orientation)
        position = np.array([*poses.position[-1, :2], robot.standing.position[2]])
        duration = FINISH_TIME * math.sqrt(robot.standing_neck_height / TALL)
        return Trajectory(
            time=np.append(poses.time, poses.time[-1] + duration),
            position=np.vstack([poses.position, position]),
            orientation=np.vstack([poses.orientation, stance]),
            joint_pos=np.vstack([poses.joint_pos, robot.standing.joint_pos]),
        )

    def _pace(self, poses: Trajectory) -> tuple[Trajectory, float]:
        """Slow down if joints are too fast, and sample at the control period."""
        robot, steps = self.robot, np.diff(poses.time)
        # The slope of the interpolation is at most 1.5 times that of the way between two frames.
        speed = 1.5 * np.abs(np.diff(poses.joint_pos, axis=0)) / steps[:, None]
        excess = np.max(speed / (SPEED_SHARE * robot.max_velocity), axis=1)
        knots = np.concatenate([[0.0], np.cumsum(steps * np.maximum(excess, 1.0))])
        if knots[-1] > MAX_DURATION:
            raise ValueError(
                f"the motion would last {knots[-1]:.0f} s, expected at most {MAX_DURATION:g} s "
                "(--begin and --end choose a part)"
            )
        count = math.ceil(knots[-1] / robot.control_period - 1e-9) + 1
        time = robot.control_period * np.arange(count)
        at = np.minimum(time, knots[-1])
        turns = Slerp(knots, Rotation.from_quat(poses.orientation, scalar_first=True))
        joint_pos = PchipInterpolator(knots, poses.joint_pos, axis=0)(at)
        paced = Trajectory(
            time=time,
            position=PchipInterpolator(knots, poses.position, axis=0)(at),
            orientation=turns(at).as_quat(scalar_first=True),
            joint_pos=np.clip(joint_pos, robot.lower, robot.upper),  # rounding may exceed them
        )
        return self._ground(paced), float(knots[-1] / poses.time[-1])

    def _make_motion(
        self, poses: Trajectory, name: str, clip: Clip, time: Array, *, is_finished: bool
    ) -> Motion:
        end = self._classify(poses, -1)
        return Motion(
            name=name,
            robot=self.robot.name,
            start_class=self._classify(poses, 0),
            end_class=STANDING if is_finished else NO_END if end == "squat" else end,
            strategy=CAPTURED,
            time=poses.time,
            position=poses.position,
            orientation=poses.orientation,
            joint_pos=poses.joint_pos,
            joint_target=poses.joint_pos,
            provenance={
                "program": "getup mocap import",
                "clip": clip.file.name,
                "from_s": float(time[0]),
                "to_s": float(time[-1]),
            },
        )

    def _classify(self, poses: Trajectory, frame: int) -> StartClass:
        side = classify(poses.orientation[frame])
        if side is not None:
            return side
        is_high = poses.position[frame, 2] >= STANDING_HEIGHT * self.robot.standing.position[2]
        is_upright = quaternion.tilt(poses.orientation[frame]) < UPRIGHT
        return "standing" if is_high and is_upright else "squat"


def _choose_frames(clip: Clip, begin: float, end: float) -> Frames:
    """Choose the frames to solve, from the first to the last of a part."""
    inside = np.flatnonzero((clip.time >= begin - 1e-9) & (clip.time <= end + 1e-9))
    if len(inside) < 2:
        raise ValueError(
            f"clip {clip.file}: frames from {max(begin, 0.0):g} s on: {len(inside)}; it lasts "
            f"{clip.time[-1]:.2f} s, expected two frames or more (--begin, --end)"
        )
    stride = max(round(SOLVE_PERIOD / clip.period), 1)
    return np.unique(np.append(inside[::stride], inside[-1]))


def _angle(a: Array, b: Array) -> float:
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))
