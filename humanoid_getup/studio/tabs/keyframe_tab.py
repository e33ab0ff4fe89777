"""Keyframes tab: the keys of a motion, authored, mirrored, timed, played in physics and stored."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import get_args

import numpy as np

from humanoid_getup.commands.files import shorten_path
from humanoid_getup.commands.inputs import find_keyframes
from humanoid_getup.commands.motions.build_motions import BuildRequest
from humanoid_getup.commands.motions.import_keys import AddedKeys, ImportKeysRequest, import_keys
from humanoid_getup.commands.motions.preview_motion import PreviewRequest
from humanoid_getup.commands.options import write_command
from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.keyframes_file import KEYFRAMES
from humanoid_getup.motions.motion import MAX_DURATION, STANDING, START_CLASSES, EndClass
from humanoid_getup.motions.trial import Trial
from humanoid_getup.studio.edit_keys import (
    LEAST_DURATION,
    KeyEditor,
    place_key,
    play_keys,
    store_keyframes,
)
from humanoid_getup.studio.form import Form
from humanoid_getup.studio.page import Page, add_button_row
from humanoid_getup.studio.plain_text import escape, make_block
from humanoid_getup.studio.pose_robot import Squats
from humanoid_getup.studio.takes import locate_key, make_key_take

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
        self.editor, self._squats = KeyEditor(robot), Squats(robot)
        self._played: tuple[Keyframes, Trial] | None = None
        self._job = page.add_job(partial(play_keys, robot), self._show_trial)
        self._store = KeyStore(page, self.editor, self._open)
        with page.gui.add_folder("New motion"):
            self._add_beginning()
        with page.gui.add_folder("Keys"):
            self._list = KeyList(page, self.editor, self._show)
            page.add_button("Play keys", self._play, main=True)
            page.add_button("Cancel", self._job.cancel)
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
        self.editor.begin(name, self._start.value, end, posed)
        self._list.choose(0)
        self._page.say(f"{name} begins with the present pose.")

    def _open(self, keyframes: Keyframes) -> None:
        """Edit a motion from a file, from its first key on."""
        self.editor.open(keyframes)
        self._list.choose(0)
        self._show(0)

    def _show(self, number: int) -> None:
        """Pose the robot in a key; after a rollout of these keys, where it was then."""
        keyframes, played = self.editor.keyframes, self._played
        if played is not None and played[0] is keyframes:
            self._page.pose(locate_key(played[1], number))
        else:
            self._page.pose(place_key(self._page.world, keyframes, number))

    def _play(self) -> None:
        keyframes = self.editor.keyframes
        self._page.say(f"{keyframes.name} is played in physics …")
        self._job.ask(keyframes)

    def _show_trial(self, keyframes: Keyframes, trial: Trial) -> None:
        self._page.timeline.load(make_key_take(trial, self._page.world))
        self._page.say(f"{keyframes.name} {trial.describe()}.")
        self._played = keyframes, trial

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

    def __init__(self, page: Page, editor: KeyEditor, show: Callable[[int], None]) -> None:
        """Add the elements where the caller is adding them; ``show`` shows a key."""
        self._page, self._editor, self._show = page, editor, show
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
            "Delete": lambda: editor.delete(self.number),
            "Show": self._choose,
        }
        add_button_row(page, "Chosen key", change)
        move = {"Earlier": lambda: self._swap(-1), "Later": lambda: self._swap(1)}
        add_button_row(page, "Move key", move)
        whole = {"Mirror motion": editor.mirror, "Undo": editor.undo}
        add_button_row(page, "Whole motion", whole)
        editor.when_changed.append(self._update)

    @property
    def number(self) -> int:
        """Return the chosen key, counted from 0."""
        return self._choice.options.index(self._choice.value)

    def choose(self, number: int) -> None:
        """Choose a key, without showing it."""
        self._choice.value = self._choice.options[number]
        self._show_duration(self._editor.keyframes)

    def _update(self, keyframes: Keyframes) -> None:
        """List the keys of a changed motion; the chosen place stays."""
        number = min(self.number, len(keyframes.keys) - 1)
        self._choice.options = list_keys(keyframes, self._editor.count)
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
        self._show_duration(self._editor.keyframes)
        self._show(self.number)

    def _time(self) -> None:
        self._editor.time(self.number, self._duration.value)

    def _add(self) -> None:
        self._editor.insert(self.number, self._page.start.joint_pos)
        self.choose(min(self.number + 1, self._editor.count - 1))

    def _replace(self) -> None:
        self._editor.put(self.number, self._page.start.joint_pos)

    def _swap(self, way: int) -> None:
        number = self.number
        self._editor.swap(number, number + way)
        self.choose(number + way)


def list_keys(keyframes: Keyframes, count: int) -> list[str]:
    """List the keys of a motion with their times and durations; those after a count are stances."""
    times = np.concatenate([[0.0], np.cumsum(keyframes.duration)])
    names = [f"{number}" if number <= count else "stand" for number in range(1, len(times) + 1)]
    after = ["", *(f" (+{duration:.2f})" for duration in keyframes.duration)]
    return [f"{name}: {t:.2f} s{d}" for name, t, d in zip(names, times, after, strict=True)]


OWN: str = "the robot"
"""Source of the robot's own keyframes."""
SUFFIX = ".toml"
NO_MOTION: str = "none"


class KeyStore:
    """Elements that open, store and import motions."""

    def __init__(self, page: Page, editor: KeyEditor, opened: Callable[[Keyframes], None]) -> None:
        """Add the elements that open motions, for which ``opened`` is called then."""
        self._page, self._editor, self._opened = page, editor, opened
        self._importing = page.add_job(import_keys, self._show_added)
        self._stored: Keyframes | None = None
        self._file: Path | None = None  # in which it is stored; None for the robot's own
        gui = page.gui
        with gui.add_folder("Open"):
            self._source = gui.add_dropdown("From", (OWN,))
            self._name = gui.add_dropdown("Motion", (NO_MOTION,))
            page.add_button("Open", self._open)
        self._source.on_update(page.answer(self._list_motions))
        self._list_files()
        page.answer(self._list_motions)(None)

    def add_storing(self) -> None:
        """Add the elements that store the motion."""
        gui = self._page.gui
        self._target = gui.add_text("Keyframes file", KEYFRAMES)
        self._page.add_button("Store", self._store)
        self._command = gui.add_markdown("")
        self._editor.when_changed.append(lambda _: self._show_command())
        self._show_command()

    def add_import(self) -> None:
        """Add the elements that import another program's keys."""
        labels = {"file": "Key file", "page": "Pages", "clip": "Limit angles"}
        self._form = Form(self._page.gui, ImportKeysRequest, labels)
        self._page.add_button("Import", self._import)

    # Open -------------------------------------------------------------------------------------

    def _list_files(self) -> None:
        self._source.options = (OWN, *self._page.folders.list_files(SUFFIX))

    def _list_motions(self) -> None:
        self._name.options = (NO_MOTION,)
        if self._source.value == OWN and not (self._page.world.robot.folder / KEYFRAMES).exists():
            return
        names = tuple(keyframes.name for keyframes in self._load())
        self._name.options = names or (NO_MOTION,)

    def _load(self, *names: str) -> list[Keyframes]:
        return find_keyframes(self._page.world.robot, names, self._find_source())

    def _find_source(self) -> Path | None:
        source = self._source.value
        return None if source == OWN else self._page.folders.resolve(source)

    def _open(self) -> None:
        (keyframes,) = self._load(self._name.value)
        self._stored, self._file = keyframes, self._find_source()
        self._opened(keyframes)
        self._page.say(f"Opened {keyframes.name} of {self._source.value}.")

    # Store ------------------------------------------------------------------------------------

    def _store(self) -> None:
        keyframes, path = self._editor.keyframes, self._find_target()
        store_keyframes(path, keyframes, self._page.world.robot)
        self._stored, self._file = keyframes, path
        self._list_files()
        self._show_command()
        self._page.say(f"Stored {keyframes.name} in {self._page.folders.name(path)}.")

    def _find_target(self) -> Path:
        return self._page.folders.resolve_new("keyframes file", self._target.value, SUFFIX)

    def _show_command(self) -> None:
        """Show the commands that play and build the motion as it is stored."""
        self._command.content = "A command plays stored keys."
        if self._stored is None or self._editor.keyframes is not self._stored:
            return
        name, robot, own = self._stored.name, self._page.request.robot, self._is_own
        file = None if own or self._file is None else shorten_path(self._file)
        preview = PreviewRequest(name=name, robot=robot, keyframes=file)
        lines = [write_command("motions preview", preview)]
        if own:
            lines.append(write_command("motions build", BuildRequest(names=(name,), robot=robot)))
        self._command.content = make_block("\n".join(lines))

    @property
    def _is_own(self) -> bool:
        """Return whether the motion is stored among the robot's own."""
        own = (self._page.world.robot.folder / KEYFRAMES).resolve()
        return self._file is None or self._file == own

    # Import -----------------------------------------------------------------------------------

    def _import(self) -> None:
        given = self._form.read()
        request = ImportKeysRequest(
            file=self._page.folders.resolve(given.pop("file")),
            robot=self._page.request.robot,
            out=self._find_target(),
            **given,
        )
        request.check()
        self._page.say(f"Keys of {request.file.name} are imported …")
        self._importing.ask(request)

    def _show_added(self, _: ImportKeysRequest, added: AddedKeys) -> None:
        """Open the first motion that was added, and tell how each ends."""
        robot, trials = self._page.world.robot, added.trials
        (keyframes,) = find_keyframes(robot, [trials[0].keyframes.name], added.file)
        self._stored, self._file = keyframes, added.file
        self._list_files()
        self._opened(keyframes)
        told = [f"{trial.keyframes.name} {trial.describe()}" for trial in trials]
        notes = [note for imported in added.imported for note in imported.notes]
        self._page.say(f"Imported: {'; '.join([*told, *notes])}.")
