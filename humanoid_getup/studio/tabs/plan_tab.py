"""Plan tab: rises are planned in the background, played on the twin, compared and saved."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from shutil import copytree, rmtree
from typing import TYPE_CHECKING

from humanoid_getup.commands.files import shorten_path, staging
from humanoid_getup.commands.get_up.rise import RiseRequest, rise
from humanoid_getup.commands.options import write_command
from humanoid_getup.studio.form import Form
from humanoid_getup.studio.plain_text import make_block, name_side
from humanoid_getup.studio.takes import make_rise_take
from robots import Posture
from robots.description.posture_file import format_posture
from robots.kinematics import read_posture
from robots.storage.files import write_atomically

if TYPE_CHECKING:
    import viser

    from humanoid_getup.commands.get_up.results import FinishedRise
    from humanoid_getup.studio.page import Page
    from humanoid_getup.studio.takes import Take

THE_PLAN, NOTHING = "the plan", "nothing"
NO_RISES: tuple[str, ...] = (NOTHING,)
GHOSTS: tuple[str, ...] = (THE_PLAN, NOTHING)
APART = 1.0  # standing neck heights between two rises that are shown side by side
MOST_KEPT = 12
"""Number of rises that can be compared."""
OPTIONS = {
    "prefer": "Prefer",
    "torque_limit": "Torque limit",
    "limit_by": "Limited by",
    "search_budget": "Search budget",
    "attempts": "Attempts",
}
GHOST = "What is drawn translucent beside the rise."
START, KEY = "start.json", "key_{}.json"


@dataclass(frozen=True, kw_only=True, eq=False)
class ListedRise:
    """A rise that was planned."""

    take: Take
    request: RiseRequest

    @property
    def folder(self) -> Path:
        """Return the folder of its files."""
        assert self.request.out is not None
        return self.request.out


class PlanTab:
    """Elements that plan a rise from the posture of the page, and compare rises."""

    def __init__(self, page: Page) -> None:
        self._page, gui = page, page.gui
        self._keys: list[Posture] = []
        self._kept: dict[str, ListedRise] = {}
        busy = "a rise is being planned, expected its end"
        self._job = page.add_job(rise, self._keep, busy=busy)
        self._count = 0
        self._form = Form(gui, RiseRequest, OPTIONS, attempts=1)
        with gui.add_folder("Key postures"):
            self._listed = gui.add_markdown("")
            page.add_button("Grab key", self._grab)
            page.add_button("Remove last key", self._drop_key)
        page.add_job_buttons("Plan", self._begin, self._job)
        with gui.add_folder("Rises"):
            self._shown: viser.GuiDropdownHandle[str] = gui.add_dropdown("Show", NO_RISES)
            self._ghost: viser.GuiDropdownHandle[str] = gui.add_dropdown(
                "Ghost", GHOSTS, hint=GHOST
            )
            self._apart = gui.add_checkbox("Side by side", False)
        with gui.add_folder("File"):
            self._folder = gui.add_text("Folder", "rise")
            page.add_button("Save", self._save)
            page.add_button("Copy as command", self._write_command)
            self._command = gui.add_markdown("")
        for element in (self._shown, self._ghost, self._apart):
            page.on_change(element, self._show)
        self._list_keys()

    # Key postures -----------------------------------------------------------------------------

    def _grab(self) -> None:
        """Make a key posture of what is shown."""
        page = self._page
        if (picture := page.timeline.picture) is None:
            raise ValueError("nothing is shown, expected a posture")
        self._keys.append(read_posture(page.world.robot, page.world.model, picture.qpos))
        self._list_keys()

    def _drop_key(self) -> None:
        self._keys = self._keys[:-1]
        self._list_keys()

    def _list_keys(self) -> None:
        count = len(self._keys)
        self._listed.content = (
            f"{count} to rise through, in the order in which they were grabbed."
            if count
            else "None: *Grab key* makes one of what the scene shows, to rise through it."
        )

    # Planning ---------------------------------------------------------------------------------

    def _begin(self) -> None:
        """Plan from the posture of the page, play on the twin, and judge."""
        self._job.check()
        self._count += 1
        folder = self._page.scratch / f"rise_{self._count}"
        request = self._make_request(folder)
        request.check()
        self._job.ask(request)

    def _make_request(self, folder: Path) -> RiseRequest:
        """Make the request, and write its start and key postures into its folder."""
        page, robot = self._page, self._page.world.robot
        folder.mkdir(parents=True, exist_ok=True)
        files = {START: page.start}
        files |= {KEY.format(n): key for n, key in enumerate(self._keys, start=1)}
        for name, posture in files.items():
            write_atomically(folder / name, format_posture(posture, robot))
        given = page.request
        return RiseRequest(
            robot=given.robot,
            body=given.body,
            load=given.load,
            scene=given.scene,
            seed=given.seed,
            origin=str(folder / START),
            key=tuple(str(folder / name) for name in files if name != START),
            out=folder,
            **self._form.read(),
        )

    def _keep(self, request: RiseRequest, done: FinishedRise) -> None:
        """Show a rise, and list it."""
        result = done.rise
        ended = f"stands at {done.report.stand_time_s:.1f} s" if result.stood else "does not stand"
        name = f"{self._count}: {name_side(result.start_class)}, {ended}"
        take = make_rise_take(self._page.world, result, name)
        if take is None:
            raise ValueError(f"nothing was played: {result.reason}")
        self._kept[name] = ListedRise(take=take, request=request)
        while len(self._kept) > MOST_KEPT:
            rmtree(self._kept.pop(next(iter(self._kept))).folder)
        self._shown.options = tuple(self._kept)
        self._ghost.options = (*GHOSTS, *self._kept)
        self._shown.value = name
        self._page.say(f"{result}")
        self._show()

    # Comparing --------------------------------------------------------------------------------

    def _show(self) -> None:
        """Show the chosen rise with the chosen ghost."""
        self._command.content = ""
        if (kept := self._kept.get(self._shown.value)) is None:
            return
        take, ghost = kept.take, kept.take.ghost
        if self._ghost.value == NOTHING:
            ghost = None
        elif (other := self._kept.get(self._ghost.value)) is not None:
            rows = [other.take.find(time - take.time[0]) for time in take.time]
            ghost = other.take.qpos[rows]
        if ghost is not None and self._apart.value:
            robot = self._page.world.robot
            ghost = ghost.copy()
            sideways = robot.layout(self._page.world.model).root_qpos + 1
            ghost[:, sideways] += APART * robot.standing_neck_height
        self._page.timeline.load(replace(take, ghost=ghost))

    # Files ------------------------------------------------------------------------------------

    def _save(self) -> None:
        """Copy the files of the rise that is shown, which the command would have written."""
        folder, kept = self._choose_folder()
        names = [path.name for path in sorted(kept.folder.iterdir())]
        with staging(folder, names) as staged:
            copytree(kept.folder, staged, dirs_exist_ok=True)
        self._page.say(f"Saved {', '.join(names)} in {self._page.folders.name(folder)}.")

    def _write_command(self) -> None:
        """Show the command that makes the same rise, and write the postures that it names."""
        folder, kept = self._choose_folder()
        folder.mkdir(parents=True, exist_ok=True)
        request = kept.request
        named = [kept.folder / START, *map(Path, request.key)]
        for file in named:
            write_atomically(folder / file.name, file.read_text())
        shown = shorten_path(folder)
        moved = replace(
            request,
            origin=str(shown / START),
            key=tuple(str(shown / Path(file).name) for file in request.key),
            out=shown,
        )
        self._command.content = make_block(write_command("rise", moved))

    def _choose_folder(self) -> tuple[Path, ListedRise]:
        kept = self._kept.get(self._shown.value)
        if kept is None:
            raise ValueError("no rise is shown, expected a planned one")
        names = [path.name for path in kept.folder.iterdir()]
        return self._page.folders.resolve_folder(self._folder.value, names), kept
