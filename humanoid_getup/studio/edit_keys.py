"""Edits the keys of a motion, one change at a time, and stores them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from humanoid_getup.commands.errors import BadInputError, refusing
from humanoid_getup.motions.build import ATTITUDES, try_out
from humanoid_getup.motions.imported_keyframes import (
    TORQUE_SHARE,
    choose_free,
    find_travel_time,
)
from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.keyframes_file import NAMED, load_keyframes
from humanoid_getup.motions.keyframes_writer import (
    append_keyframes,
    replace_keyframes,
    save_keyframes,
)
from humanoid_getup.motions.motion import (
    MAX_DURATION,
    MIRRORED_CLASS,
    MIRRORED_SUFFIX,
    NAME,
    STANDING,
    EndClass,
    StartClass,
)
from humanoid_getup.motions.trial import Trial
from humanoid_getup.progress.callback import Cancel, ProgressMonitor, Report
from humanoid_getup.scenes.scene import FLAT_SCENE
from humanoid_getup.simulation.world import World
from humanoid_getup.studio.pose_robot import put_down
from robots import Posture, Robot, quaternion
from robots.quaternion import Array
from robots.storage.validation import outside, shown

STRATEGY = "posed by hand"
COST = 0.8  # of a second, and of a newton meter, that the search for better keys begins with
LEAST_DURATION = 0.02  # s
MOST_UNDONE = 100
"""Number of states that are kept."""


class KeyEditor:
    """Changes the keys of one motion of a robot, which are counted from 0; changes can be undone.

    The stance at the end of a rise follows the keys, and is none of them.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot, self._states = robot, list[Keyframes]()
        self.when_changed: list[Callable[[Keyframes], None]] = []
        """Called after every change."""

    @property
    def keyframes(self) -> Keyframes:
        """Return the motion."""
        if not self._states:
            raise ValueError("no motion yet, expected one that was opened, or New")
        return self._states[-1]

    @property
    def count(self) -> int:
        """Return the number of keys that can be changed."""
        return len(self.keyframes.keys) - (self.keyframes.end_class == STANDING)

    def open(self, keyframes: Keyframes) -> None:
        """Replace the motion by another state of it, or by another motion."""
        self._states = [*self._states, keyframes][-MOST_UNDONE:]
        self._tell()

    def undo(self) -> None:
        """Return to the state before."""
        if len(self._states) < 2:
            raise ValueError("nothing to undo")
        self._states.pop()
        self._tell()

    def begin(
        self, name: str, start_class: StartClass, end_class: EndClass, joint_pos: Array
    ) -> None:
        """Begin a motion with one key, (n,) [rad]; that of a rise is followed by the stance."""
        if not NAME.fullmatch(name):
            raise BadInputError(f"name {shown(name)}: {NAMED}")
        stance, rises = self._robot.standing.joint_pos, end_class == STANDING
        keys = np.array([joint_pos, stance] if rises else [joint_pos])
        free, mirrored = choose_free(keys, self._robot)
        self.open(
            Keyframes(
                name=name,
                start_class=start_class,
                end_class=end_class,
                strategy=STRATEGY,
                duration=np.array([find_travel_time(joint_pos, stance)] if rises else []),
                keys=keys,
                free=free,
                mirrored=mirrored,
                torque_limit=round(TORQUE_SHARE * float(self._robot.max_torque.max()), 3),
                time_cost=COST,
                torque_cost=COST,
            )
        )

    def insert(self, after: int, joint_pos: Array) -> None:
        """Insert a key (n,) [rad] after another one, as soon as it can be reached."""
        keys, duration, at = *self._parts, min(after + 1, self.count)
        travel = find_travel_time(keys[at - 1], joint_pos)
        self._change(np.insert(keys, at, joint_pos, axis=0), np.insert(duration, at - 1, travel))

    def put(self, number: int, joint_pos: Array) -> None:
        """Replace a key by another posture, (n,) [rad]."""
        self._check_number(number)
        keys, duration = self._parts
        keys[number] = joint_pos
        self._change(keys, duration)

    def delete(self, number: int) -> None:
        """Delete a key; those after the first one keep their times."""
        self._check_number(number)
        if self.count == 1:
            raise BadInputError("the motion has one key, expected another one besides it")
        keys, duration = self._parts
        if 0 < number < len(duration):
            duration[number] += duration[number - 1]
        self._change(np.delete(keys, number, axis=0), np.delete(duration, max(number - 1, 0)))

    def swap(self, number: int, other: int) -> None:
        """Exchange two keys; the times stay."""
        self._check_number(number)
        if not 0 <= other < self.count:
            raise BadInputError(f"key {number + 1} is at an end, expected one to exchange it with")
        keys, duration = self._parts
        keys[[number, other]] = keys[[other, number]]
        self._change(keys, duration)

    def time(self, number: int, duration: float) -> None:
        """Set the time from the key before to a key, or to the stance [s]."""
        if not LEAST_DURATION <= duration <= MAX_DURATION:
            found = outside(duration, LEAST_DURATION, MAX_DURATION, "s")
            raise BadInputError(f"the duration is {found}")
        if number < 1:
            raise BadInputError("the first key begins the motion: it has no duration")
        changed = self.keyframes.duration.copy()
        changed[number - 1] = duration
        self.open(replace(self.keyframes, duration=changed))

    def mirror(self) -> None:
        """Exchange left and right of all keys, of the start and of the end."""
        motion = self.keyframes
        plain = motion.name.removesuffix(MIRRORED_SUFFIX)
        self._change(
            self._robot.mirror_joints(motion.keys),
            motion.duration,
            name=plain if plain != motion.name else motion.name + MIRRORED_SUFFIX,
            start_class=MIRRORED_CLASS.get(motion.start_class, motion.start_class),
            end_class=MIRRORED_CLASS.get(motion.end_class, motion.end_class),
        )

    @property
    def _parts(self) -> tuple[Array, Array]:
        """Return copies of keys and durations."""
        return self.keyframes.keys.copy(), self.keyframes.duration.copy()

    def _change(self, keys: Array, duration: Array, **others: Any) -> None:
        free, mirrored = choose_free(keys, self._robot)
        parts = {"keys": keys, "duration": duration, "free": free, "mirrored": mirrored}
        self.open(replace(self.keyframes, **parts, **others))

    def _check_number(self, number: int) -> None:
        if number >= self.count:
            raise BadInputError("the stance ends every rise, expected another key")

    def _tell(self) -> None:
        for update in self.when_changed:
            update(self.keyframes)


def place_key(world: World, keyframes: Keyframes, number: int) -> Posture:
    """Place a key, counted from 0: the first as the robot starts, others with an upright torso."""
    axis, angle = ATTITUDES[keyframes.start_class if number == 0 else STANDING]
    orientation = quaternion.from_axis_angle(np.array(axis), angle)
    joint_pos = keyframes.keys[number]
    return put_down(
        world, Posture(position=np.zeros(3), orientation=orientation, joint_pos=joint_pos)
    )


def store_keyframes(path: Path, keyframes: Keyframes, robot: Robot) -> None:
    """Store a motion in a keyframes file, in the place of one of that name."""
    with refusing():
        if not path.exists():
            save_keyframes(path, [keyframes], robot)
        elif keyframes.name in {each.name for each in load_keyframes(path, robot)}:
            replace_keyframes(path, [keyframes], robot)
        else:
            append_keyframes(path, [keyframes], robot)


def play_keys(
    robot: Robot, keyframes: Keyframes, report: Report | None = None, cancel: Cancel | None = None
) -> Trial:
    """Let a robot settle in the first key, and play the keys once."""
    if len(keyframes.keys) < 2:
        raise BadInputError(f"motion '{keyframes.name}' has one key, expected two or more")
    monitor = ProgressMonitor(report, cancel)
    monitor.begin("playing the keys")
    trial = try_out(World(robot, FLAT_SCENE), keyframes)
    monitor.check()
    return trial
