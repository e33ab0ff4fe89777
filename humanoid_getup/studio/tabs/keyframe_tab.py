"""Keyframes tab: the keys of a motion, authored, mirrored, timed, played in physics and stored."""

from __future__ import annotations

from typing import get_args

from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.motion import STANDING, START_CLASSES, EndClass
from humanoid_getup.motions.trial import Trial
from humanoid_getup.progress.background_job import BackgroundJob
from humanoid_getup.studio.edit_keys import KeyEditor, place_key
from humanoid_getup.studio.key_draft import KeyDraft
from humanoid_getup.studio.key_list import KeyList
from humanoid_getup.studio.key_store import KeyStore
from humanoid_getup.studio.page import Page
from humanoid_getup.studio.play_keys import KeysToPlay, play_keys
from humanoid_getup.studio.pose_robot import Squats
from humanoid_getup.studio.takes.keyframe_take import locate_key, make_take

ENDS: tuple[EndClass, ...] = get_args(EndClass)
SQUAT = (40, 100, 75)  # % of the neck's height in the stance: least, greatest, first

HEIGHT = "Of the neck, as a share of its height in the stance."
NEW = "The present pose is the first key; the stance follows as the last key of a rise."


class KeyframeTab:
    """Elements that make a motion of postures."""

    def __init__(self, page: Page) -> None:
        """Add the elements where the caller is adding them."""
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
            self._page.timeline.load(make_take(trial, self._page.world))
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
