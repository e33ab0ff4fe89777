"""Discover tab: motions are searched in the background; what was reached is a map of states."""

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
from humanoid_getup.simulation.world import World
from humanoid_getup.studio.boards.plot_board import BoardSwitch
from humanoid_getup.studio.boards.state_board import (
    WAY_UP,
    StateBoard,
    color_by_moves,
    color_by_side,
    read_search_map,
)
from humanoid_getup.studio.form import Form
from humanoid_getup.studio.plain_text import escape, make_block
from humanoid_getup.studio.takes import make_motion_take, make_way_take, place_way
from robots.kinematics import place, read_posture

if TYPE_CHECKING:
    import viser

    from humanoid_getup.commands.motions.discover_motions import DiscoveredMotions
    from humanoid_getup.posture_chains.search_file import StoredOptions
    from humanoid_getup.studio.boards.state_board import MappedState, SearchMap
    from humanoid_getup.studio.page import Page

WRITTEN = (MOTION_FOLDER, UNFINISHED, KEYFRAMES)
"""What a search writes into the folder of its robot."""
OPTIONS = {
    "seed": "Seed",
    "budget": "Budget",
    "torque_limit": "Torque limit",
    "resume": "Resume",
}
REACHED, NONE = "from lying", "none"
ALL_REACHED: tuple[str, ...] = (REACHED,)
NO_MOTION: tuple[str, ...] = (NONE,)
MOVES, SIDE = "moves", "side"


class DiscoverTab:
    """Elements that search motions of the page's robot, and show what was reached."""

    def __init__(self, page: Page) -> None:
        self._page, robot = page, page.world.robot
        if page.request.body:
            page.gui.add_markdown(
                "Motions are searched with the original body alone: open the studio without --body."
            )
            return
        self._map: SearchMap | None = None
        self._states: list[MappedState] = []
        self._searched = page.world if page.world.scene.is_flat else World(robot)
        self.board = StateBoard(page.server, robot.standing_neck_height, self._choose, page.answer)
        """Map of the states that a search has reached."""
        self._state = page.gui.add_markdown("")
        self._add_search()
        self._add_map()
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
        self._job = self._page.add_job(discover, self._tell, over=self._rest, busy=busy)
        self._page.add_job_buttons("Discover", self._begin, self._job)
        self._page.add_button("Copy as command", self._write_command)
        self._command = gui.add_markdown("")

    def _add_map(self) -> None:
        gui = self._page.gui
        with gui.add_folder("Map"):
            self._switch = BoardSwitch(self._page, "Show map", self.board, self._read_map)
            self._page.add_button("Refresh", self._refresh)
            self._of: viser.GuiDropdownHandle[str] = gui.add_dropdown("States", ALL_REACHED)
            self._color = gui.add_dropdown("Color", (MOVES, SIDE))
            gui.add_markdown("A click on a state poses the robot in it.")
        for element in (self._of, self._color):
            self._page.on_change(element, self._draw)

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
        if self._is_resumed:
            self._read_map()
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

    @property
    def _is_resumed(self) -> bool:
        return self._form.read()["resume"]

    def _write_command(self) -> None:
        """Show the command that does the same."""
        self._command.content = make_block(write_command("motions discover", self._make_request()))

    def _rest(self) -> None:
        """Show what there is after a search, however it ended."""
        self._note_files()
        if self.board.visible and MotionSearch.file(self._page.world.robot).exists():
            self._read_map()

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
            "A search is stored: it can be looked at as a map, and resumed."
            if is_begun
            else "No search is stored that can be resumed."
        )

    # Map ----------------------------------------------------------------------------------------

    def _refresh(self) -> None:
        """Read the map again, as the search stores it once a minute."""
        self._read_map()
        self._page.say(f"{self._map}.")

    def _read_map(self) -> None:
        """Read what the search has reached, and show it."""
        known = read_search_map(self._searched)
        if known is None:
            robot = self._page.world.robot
            raise BadInputError(
                f"robot '{robot.name}': no search is stored, expected {MotionSearch.file(robot)}; "
                "Discover begins one, and stores it once a minute"
            )
        self._map = known
        self._of.options = (REACHED, *dict.fromkeys(state.side for state in known.states))
        if self._is_resumed:
            self._take_options(known.options)
        self._state.content = escape(f"{known}.")
        self._draw()

    def _take_options(self, options: StoredOptions) -> None:
        """Take over the options of the search, without which it cannot be resumed."""
        for side, box in self._sides.items():
            box.value = side in options.sides
        self._form.show("seed", options.seed)
        self._form.show("torque_limit", options.torque_limit)

    def _draw(self) -> None:
        """Draw the states of a side, those of all sides, or those with a way up."""
        if self._map is None:
            return
        of, sides = self._of.value, self._of.options[1:]
        every, by_side = self._map.states, self._color.value == SIDE
        states = [s for s in every if s.side == of or (of == REACHED and s.side != WAY_UP)]
        self._states = states
        self.board.stress(None)
        self.board.show(states, color_by_side(states, sides) if by_side else color_by_moves(states))

    def _choose(self, number: int) -> None:
        """Pose the robot in a state, and put the way to it on the timeline."""
        if number >= len(self._states):
            raise BadInputError("the state is no longer on the map, expected a click on another")
        page, state = self._page, self._states[number]
        way = place_way(page.world, self._searched, state, page.start)
        self.board.stress(state)
        page.timeline.load(make_way_take(page.world, state, way), play=False)
        page.pose(read_posture(page.world.robot, page.world.model, way[state.row]))
        page.say(f"{state}.")

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
