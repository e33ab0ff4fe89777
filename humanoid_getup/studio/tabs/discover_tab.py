"""Discover tab: motions are searched in the background, and those found are shown."""

from __future__ import annotations

from typing import TYPE_CHECKING

from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.files import shorten_path
from humanoid_getup.commands.inputs import find_motion
from humanoid_getup.commands.motions.discover_motions import DiscoverRequest, discover
from humanoid_getup.commands.motions.search_motions import BUDGET, MotionSearch
from humanoid_getup.commands.options import write_command
from humanoid_getup.motions.build import UNFINISHED
from humanoid_getup.motions.keyframes_file import KEYFRAMES
from humanoid_getup.motions.motion_database import (
    FOUND_SIDES,
    MOTION_FOLDER,
    list_found,
    list_sides,
)
from humanoid_getup.studio.form import Form
from humanoid_getup.studio.plain_text import make_block
from humanoid_getup.studio.takes import make_motion_take
from robots.kinematics import place

if TYPE_CHECKING:
    import viser

    from humanoid_getup.commands.motions.discover_motions import DiscoveredMotions
    from humanoid_getup.studio.page import Page

WRITTEN = (MOTION_FOLDER, UNFINISHED, KEYFRAMES)
"""What a search writes into the folder of its robot."""
OPTIONS = {
    "seed": "Seed",
    "budget": "Budget",
    "torque_limit": "Torque limit",
    "resume": "Resume",
}
NONE = "none"
NO_MOTION: tuple[str, ...] = (NONE,)


class DiscoverTab:
    """Elements that search motions of the page's robot, and show those found."""

    def __init__(self, page: Page) -> None:
        self._page = page
        if page.request.body:
            page.gui.add_markdown(
                "Motions are searched with the original body alone: open the studio without --body."
            )
            return
        self._state = page.gui.add_markdown("")
        self._add_search()
        self._add_motions()
        self._note_files()

    def _add_search(self) -> None:
        gui = self._page.gui
        if not self._page.world.scene.is_flat:
            gui.add_markdown("Motions are searched on level ground, without the scene of the page.")
        with gui.add_folder("Sides"):
            self._sides = {
                side: gui.add_checkbox(side.capitalize(), True)
                for side in list_sides(self._page.world.robot)
            }
        self._form = Form(gui, DiscoverRequest, OPTIONS, budget=BUDGET)
        busy = "motions are being searched, expected the end"
        self._job = self._page.add_job(discover, self._tell, over=self._note_files, busy=busy)
        self._page.add_job_buttons("Discover", self._begin, self._job)
        self._page.add_button("Copy as command", self._write_command)
        self._command = gui.add_markdown("")

    def _add_motions(self) -> None:
        gui = self._page.gui
        with gui.add_folder("Motions found"):
            self._motion: viser.GuiDropdownHandle[str] = gui.add_dropdown("Found", NO_MOTION)
            self._page.add_button("Show motion", self._show_motion)

    # Searching ----------------------------------------------------------------------------------

    def _begin(self) -> None:
        """Search in the background."""
        self._job.check()
        request = self._make_request()
        request.check()
        folder = self._page.world.robot.folder
        stored = [str(file) for name in WRITTEN for file in (folder / name).glob("*")]
        self._page.folders.check_robot(folder, [*WRITTEN, *stored])
        self._page.say("The search begins …")
        self._job.ask(request)

    def _make_request(self) -> DiscoverRequest:
        robot = self._page.world.robot
        sides = tuple(side for side, box in self._sides.items() if box.value)
        if not sides:
            raise BadInputError("no side is checked, expected one at least")
        picture = self._page.folders.resolve(f"{robot.name}_motions.png")
        return DiscoverRequest(
            robot=self._page.request.robot,
            sides=() if len(sides) == len(self._sides) else sides,
            picture=shorten_path(picture),
            **self._form.read(),
        )

    def _write_command(self) -> None:
        """Show the command that does the same."""
        self._command.content = make_block(write_command("motions discover", self._make_request()))

    def _tell(self, _: DiscoverRequest, done: DiscoveredMotions) -> None:
        """Tell how a search has ended."""
        parts = [f"found {', '.join(m.name for m in done.motions)}"] if done.motions else []
        parts += [f"no motion from {', '.join(done.wanting)}"] if done.wanting else []
        parts += ["Resume goes on with the search"] if done.goes_on else []
        self._page.say("; ".join(["The search has ended", *parts]) + ".")

    def _note_files(self) -> None:
        """Offer the motions that are stored, and to go on with a search that is."""
        robot = self._page.world.robot
        found = [name for side in FOUND_SIDES for name in list_found(robot, side)]
        self._motion.options = tuple(found) or NO_MOTION
        is_begun = MotionSearch.file(robot).exists()
        self._form.show("resume", is_begun)
        self._state.content = (
            "A search is stored: it can be resumed with its own sides, seed and torque limit."
            if is_begun
            else "No search is stored that can be resumed."
        )

    # Motions ------------------------------------------------------------------------------------

    def _show_motion(self) -> None:
        """Put a motion that was found on the timeline, where the robot of the page is."""
        page, name = self._page, self._motion.value
        if name == NONE:
            raise BadInputError("no motion was found yet, expected the end of a search")
        if name not in self._motion.options:
            raise BadInputError(f"motion {name}: expected one of the list")
        motion = find_motion(page.world.robot, name)
        start = place(page.world.robot, page.world.model, page.start)
        page.timeline.load(make_motion_take(page.world, motion, start))
        page.say(f"{name}: {motion.strategy}.")
