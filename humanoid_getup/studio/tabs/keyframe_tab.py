"""Keyframes tab: the keys of a motion, authored, mirrored, timed, played in physics and stored."""

from __future__ import annotations

from collections.abc import Callable
from typing import get_args

import numpy as np

from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.motion import MAX_DURATION, STANDING, START_CLASSES, EndClass
from humanoid_getup.motions.trial import Trial
from humanoid_getup.progress.worker import BackgroundJob
from humanoid_getup.studio.edit_keys import (
    LEAST_DURATION,
    KeyEditor,
    KeysToPlay,
    place_key,
    play_keys,
)
from humanoid_getup.studio.key_store import KeyDraft, KeyStore
from humanoid_getup.studio.page import Page, add_button_row
from humanoid_getup.studio.plain_text import escape
from humanoid_getup.studio.pose_robot import Squats
from humanoid_getup.studio.takes import locate_key, make_key_take
from robots.quaternion import Array

ENDS: tuple[EndClass, ...] = get_args(EndClass)
SQUAT = (40, 100, 75)  # % of the neck's height in the stance: least, greatest, first

HEIGHT = "Of the neck, as a share of its height in the stance."
NEW = "The present pose is the first key; the stance follows as the last key of a rise."
NO_KEYS: str = "none"
SLOWER = 0.005  # s by which servos stretch a duration that is told


class KeyframeTab:
    """Elements that make a motion of postures."""

    def __init__(self, page: Page) -> None:
        self._page, robot = page, page.world.robot
        self._editor, self._squats = KeyEditor(robot=robot), Squats(robot)
        self.draft = KeyDraft()
        self._played: tuple[Keyframes, Trial] | None = None
        self._job: BackgroundJob[Trial] | None = None
        self._store = KeyStore(page, self.draft, self._open)
        with page.gui.add_folder("New motion"):
            self._add_beginning()
        with page.gui.add_folder("Keys"):
            self._list = KeyList(page, self.draft, self._editor, self._show)
            page.add_button("Play keys", self._play, main=True)
            page.add_button("Cancel", self._cancel)
        with page.gui.add_folder("Squat"):
            self._height = page.gui.add_slider(
                "Height [%]", SQUAT[0], SQUAT[1], 1, SQUAT[2], hint=HEIGHT
            )
            page.add_button("Squat", self._squat)
        with page.gui.add_folder("Store"):
            self._store.add_storing()
        with page.gui.add_folder("Import", expand_by_default=False):
            self._store.add_import()

    def _add_beginning(self) -> None:
        gui = self._page.gui
        self._name = gui.add_text("Motion name", "motion_1")
        self._start = gui.add_dropdown("Starts", START_CLASSES)
        self._end = gui.add_dropdown("Ends", ENDS, initial_value=STANDING, hint=NEW)
        self._page.add_button("New", self._begin)

    def _begin(self) -> None:
        posed = self._page.start.joint_pos
        name, end = self._name.value.strip(), self._end.value
        self.draft.put(self._editor.begin(name, self._start.value, end, posed))
        self._list.choose(0)
        self._page.say(f"{name} begins with the present pose.")

    def _open(self, keyframes: Keyframes) -> None:
        """Edit a motion from a file, from its first key on."""
        self.draft.put(keyframes)
        self._list.choose(0)
        self._show(0)

    def _show(self, number: int) -> None:
        """Pose the robot in a key; after a rollout of these keys, where it was then."""
        keyframes, played = self.draft.keyframes, self._played
        if played is not None and played[0] is keyframes:
            self._page.pose(locate_key(played[1], number))
        else:
            self._page.pose(place_key(self._page.world, keyframes, number))

    def _play(self) -> None:
        self._cancel()
        keyframes = self.draft.keyframes
        request = KeysToPlay(robot=self._page.world.robot, keyframes=keyframes)

        def show(trial: Trial) -> None:
            self._page.timeline.load(make_key_take(trial, self._page.world))
            self._page.say(f"{keyframes.name} {trial.describe()}.")
            self._played = keyframes, trial

        self._page.say(f"{keyframes.name} is played in physics …")
        self._job = self._page.run(play_keys, request, show)

    def _cancel(self) -> None:
        if self._job is not None:
            self._job.cancel()

    def _squat(self) -> None:
        squat, posture = self._squats.find(self._height.value / 100.0)
        share = float((abs(squat.torque) / self._page.world.robot.max_torque).max())
        self._page.pose(posture)
        self._page.say(
            f"A balanced squat at {squat.neck_share:.0%} of standing height; "
            f"it takes up to {share:.0%} of a servo's torque."
        )


class KeyList:
    """Elements that list, choose, time and change keys."""

    def __init__(
        self, page: Page, draft: KeyDraft, editor: KeyEditor, show: Callable[[int], None]
    ) -> None:
        """Add the elements where the caller is adding them; ``show`` shows a key."""
        self._page, self._draft, self._editor, self._show = page, draft, editor, show
        gui = page.gui
        self._state = gui.add_markdown("")
        self._choice = gui.add_dropdown("Key", (NO_KEYS,))
        self._duration = gui.add_number(
            "Duration [s]",
            LEAST_DURATION,
            min=LEAST_DURATION,
            max=MAX_DURATION,
            step=0.01,
            hint="Time from the key before the chosen one.",
        )
        page.on_change(self._choice, self._choose)
        page.on_change(self._duration, self._time)
        page.add_button("Add key", self._add)
        change = {
            "Replace": self._replace,
            "Delete": lambda: draft.put(editor.delete(draft.keyframes, self.number)),
            "Show": self._choose,
        }
        add_button_row(page, "Chosen key", change)
        move = {"Earlier": lambda: self._swap(-1), "Later": lambda: self._swap(1)}
        add_button_row(page, "Move key", move)
        whole = {
            "Mirror motion": lambda: draft.put(editor.mirror(draft.keyframes)),
            "Undo": draft.undo,
        }
        add_button_row(page, "Whole motion", whole)
        draft.when_changed.append(self._update)

    @property
    def number(self) -> int:
        """Return the chosen key, counted from 0."""
        return self._choice.options.index(self._choice.value)

    def choose(self, number: int) -> None:
        """Choose a key, without showing it."""
        self._choice.value = self._choice.options[number]
        self._show_duration(self._draft.keyframes)

    def _update(self, keyframes: Keyframes) -> None:
        """List the keys of a changed motion; the chosen place stays."""
        number = min(self.number, len(keyframes.keys) - 1)
        self._choice.options = list_keys(keyframes, self._editor.count(keyframes))
        self._state.content = self._describe(keyframes)
        self.choose(number)

    def _describe(self, keyframes: Keyframes) -> str:
        way = f"{keyframes.start_class} to {keyframes.end_class}"
        lines = [f"**{escape(keyframes.name)}**, {way}, {keyframes.duration.sum():.2f} s"]
        if len(keyframes.keys) > 1:
            took = np.diff(keyframes.times(self._page.world.robot))
            slower = np.flatnonzero(took > keyframes.duration + SLOWER)
            needed = ", ".join(f"{took[k]:.2f} s to key {k + 2}" for k in slower)
            lines += [f"The servos need longer: {needed}."] if needed else []
        return "\n\n".join(lines)

    def _show_duration(self, keyframes: Keyframes) -> None:
        number = self.number
        self._duration.disabled = number == 0
        if number > 0:
            self._duration.value = round(float(keyframes.duration[number - 1]), 3)

    def _choose(self) -> None:
        self._show_duration(self._draft.keyframes)
        self._show(self.number)

    def _time(self) -> None:
        editor, number = self._editor, self.number
        self._draft.put(editor.time(self._draft.keyframes, number, self._duration.value))

    def _add(self) -> None:
        self._draft.put(self._editor.insert(self._draft.keyframes, self.number, self._posed))
        self.choose(min(self.number + 1, self._editor.count(self._draft.keyframes) - 1))

    def _replace(self) -> None:
        self._draft.put(self._editor.put(self._draft.keyframes, self.number, self._posed))

    def _swap(self, way: int) -> None:
        number = self.number
        self._draft.put(self._editor.swap(self._draft.keyframes, number, number + way))
        self.choose(number + way)

    @property
    def _posed(self) -> Array:
        return self._page.start.joint_pos


def list_keys(keyframes: Keyframes, count: int) -> list[str]:
    """List the keys of a motion with their times and durations; those after a count are stances."""
    times = np.concatenate([[0.0], np.cumsum(keyframes.duration)])
    names = [f"{number}" if number <= count else "stand" for number in range(1, len(times) + 1)]
    after = ["", *(f" (+{duration:.2f})" for duration in keyframes.duration)]
    return [f"{name}: {t:.2f} s{d}" for name, t, d in zip(names, times, after, strict=True)]
