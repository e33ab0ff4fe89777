"""Edits the keys of a motion, one change at a time, and stores them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

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


@dataclass(frozen=True, kw_only=True)
class KeyEditor:
    """Changes the keys of a robot's motion, which are counted from 0.

    The stance at the end of a rise follows the keys, and is none of them.
    """

    robot: Robot

    def begin(
        self, name: str, start_class: StartClass, end_class: EndClass, joint_pos: Array
    ) -> Keyframes:
        """Begin a motion with one key, (n,) [rad]; that of a rise is followed by the stance."""
        if not NAME.fullmatch(name):
            raise BadInputError(f"name {shown(name)}: {NAMED}")
        stance, rises = self.robot.standing.joint_pos, end_class == STANDING
        keys = np.array([joint_pos, stance] if rises else [joint_pos])
        free, mirrored = choose_free(keys, self.robot)
        return Keyframes(
            name=name,
            start_class=start_class,
            end_class=end_class,
            strategy=STRATEGY,
            duration=np.array([find_travel_time(joint_pos, stance)] if rises else []),
            keys=keys,
            free=free,
            mirrored=mirrored,
            torque_limit=round(TORQUE_SHARE * float(self.robot.max_torque.max()), 3),
            time_cost=COST,
            torque_cost=COST,
        )

    def count(self, keyframes: Keyframes) -> int:
        """Return the number of keys that can be changed."""
        return len(keyframes.keys) - (keyframes.end_class == STANDING)

    def insert(self, keyframes: Keyframes, after: int, joint_pos: Array) -> Keyframes:
        """Insert a key (n,) [rad] after another one, as soon as it can be reached."""
        keys, at = keyframes.keys, min(after + 1, self.count(keyframes))
        travel = find_travel_time(keys[at - 1], joint_pos)
        return self._change(
            keyframes,
            np.insert(keys, at, joint_pos, axis=0),
            np.insert(keyframes.duration, at - 1, travel),
        )

    def put(self, keyframes: Keyframes, number: int, joint_pos: Array) -> Keyframes:
        """Replace a key by another posture, (n,) [rad]."""
        self._check_number(keyframes, number)
        keys = keyframes.keys.copy()
        keys[number] = joint_pos
        return self._change(keyframes, keys, keyframes.duration)

    def delete(self, keyframes: Keyframes, number: int) -> Keyframes:
        """Delete a key; those after the first one keep their times."""
        self._check_number(keyframes, number)
        if self.count(keyframes) == 1:
            raise BadInputError("the motion has one key, expected another one besides it")
        duration = keyframes.duration
        if 0 < number < len(duration):
            duration = duration.copy()
            duration[number] += duration[number - 1]
        return self._change(
            keyframes,
            np.delete(keyframes.keys, number, axis=0),
            np.delete(duration, max(number - 1, 0)),
        )

    def swap(self, keyframes: Keyframes, number: int, other: int) -> Keyframes:
        """Exchange two keys; the times stay."""
        self._check_number(keyframes, number)
        if not 0 <= other < self.count(keyframes):
            raise BadInputError(f"key {number + 1} is at an end, expected one to exchange it with")
        keys = keyframes.keys.copy()
        keys[[number, other]] = keys[[other, number]]
        return self._change(keyframes, keys, keyframes.duration)

    def time(self, keyframes: Keyframes, number: int, duration: float) -> Keyframes:
        """Set the time from the key before to a key, or to the stance [s]."""
        if not LEAST_DURATION <= duration <= MAX_DURATION:
            found = outside(duration, LEAST_DURATION, MAX_DURATION, "s")
            raise BadInputError(f"the duration is {found}")
        if number < 1:
            raise BadInputError("the first key begins the motion: it has no duration")
        changed = keyframes.duration.copy()
        changed[number - 1] = duration
        return replace(keyframes, duration=changed)

    def mirror(self, keyframes: Keyframes) -> Keyframes:
        """Exchange left and right of all keys, of the start and of the end."""
        plain = keyframes.name.removesuffix(MIRRORED_SUFFIX)
        mirrored = replace(
            keyframes,
            name=plain if plain != keyframes.name else keyframes.name + MIRRORED_SUFFIX,
            start_class=MIRRORED_CLASS.get(keyframes.start_class, keyframes.start_class),
            end_class=MIRRORED_CLASS.get(keyframes.end_class, keyframes.end_class),
        )
        keys = self.robot.mirror_joints(keyframes.keys)
        return self._change(mirrored, keys, keyframes.duration)

    def _change(self, keyframes: Keyframes, keys: Array, duration: Array) -> Keyframes:
        free, mirrored = choose_free(keys, self.robot)
        return replace(keyframes, keys=keys, duration=duration, free=free, mirrored=mirrored)

    def _check_number(self, keyframes: Keyframes, number: int) -> None:
        if number >= self.count(keyframes):
            raise BadInputError("the stance ends every rise, expected another key")


class KeyDraft:
    """One motion at a time; every change can be undone."""

    def __init__(self) -> None:
        self._states: list[Keyframes] = []
        self.when_changed: list[Callable[[Keyframes], None]] = []
        """Called after every change."""

    @property
    def keyframes(self) -> Keyframes:
        """Return the motion."""
        if not self._states:
            raise ValueError("no motion yet, expected one that was opened, or New")
        return self._states[-1]

    def put(self, keyframes: Keyframes) -> None:
        """Replace the motion by another state of it, or by another motion."""
        self._states = [*self._states, keyframes][-MOST_UNDONE:]
        self._tell()

    def undo(self) -> None:
        """Return to the state before."""
        if len(self._states) < 2:
            raise ValueError("nothing to undo")
        self._states.pop()
        self._tell()

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


@dataclass(frozen=True, kw_only=True, eq=False)
class KeysToPlay:
    """Keys of a robot."""

    robot: Robot
    keyframes: Keyframes


def play_keys(
    request: KeysToPlay, report: Report | None = None, cancel: Cancel | None = None
) -> Trial:
    """Let a robot settle in the first key, and play the keys once."""
    keyframes = request.keyframes
    if len(keyframes.keys) < 2:
        raise BadInputError(f"motion '{keyframes.name}' has one key, expected two or more")
    monitor = ProgressMonitor(report, cancel)
    monitor.begin("playing the keys")
    trial = try_out(World(request.robot, FLAT_SCENE), keyframes)
    monitor.check()
    return trial
