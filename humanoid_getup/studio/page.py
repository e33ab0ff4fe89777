"""Page: what all tabs of the studio share."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from humanoid_getup.commands.errors import BadInputError, refusing
from humanoid_getup.progress.callback import Cancel, Progress
from humanoid_getup.progress.worker import BackgroundJob, JobEnd, LatestJob
from humanoid_getup.studio.folders import Folders
from humanoid_getup.studio.plain_text import make_status
from humanoid_getup.studio.pose_robot import stand
from humanoid_getup.studio.timeline import Timeline
from robots import Posture
from robots.kinematics import place

if TYPE_CHECKING:
    import viser

    from humanoid_getup.commands.look.studio import StudioRequest
    from humanoid_getup.simulation.world import World
PLAIN = (92, 104, 117)
"""Color of the buttons that are not the main one of a tab."""
Request = TypeVar("Request")
Result = TypeVar("Result")


def add_button_row(page: Page, label: str, actions: dict[str, Callable[[], None]]) -> None:
    """Add buttons where the caller is adding elements, by their labels, in order."""
    answers = {name: page.answer(action) for name, action in actions.items()}

    def run(event: viser.GuiEvent[viser.GuiButtonGroupHandle]) -> None:
        answers[event.target.value](event)

    page.gui.add_button_group(label, tuple(actions)).on_click(run)


class Page:
    """Robot, scene, timeline, folders and status line; and the posture from which a rise starts.

    All browsers see one state. Callbacks of the page run one at a time.
    """

    def __init__(
        self,
        request: StudioRequest,
        server: viser.ViserServer,
        world: World,
        timeline: Timeline,
        scratch: Path,
    ) -> None:
        """Prepare; the robot stands. ``scratch`` is an empty folder for files of jobs."""
        self.scratch = scratch
        self.request, self.server, self.world, self.timeline = request, server, world, timeline
        self.gui = server.gui
        self.folders = Folders(request.folder)
        self.start: Posture = stand(world)
        """Posture from which a rise starts."""
        self.when_posed: list[Callable[[Posture], None]] = []
        """Called after the start has changed."""
        self.hide_board: Callable[[], None] = lambda: None
        """Hides the board that a tab has put behind the robot."""
        self.when_files_changed: list[Callable[[], None]] = []
        """Called after files were saved that another tab may open."""
        self.tab = ""
        """Name of the tab that is being filled; its elements speak in its name later on."""
        self._speaking = threading.local()
        self._lock = threading.RLock()
        self._is_closed = False
        self._status = server.gui.add_html(make_status("", "Ready."))
        self.jobs: list[BackgroundJob[Any]] = []
        """Those that were begun last, the last one first."""
        self._latest: list[LatestJob[Any, Any]] = []

    def pose(self, posture: Posture) -> None:
        """Make a posture the start, and show it."""
        self.start = posture
        qpos = place(self.world.robot, self.world.model, posture)
        self.timeline.pose(qpos, is_start=True)
        for update in self.when_posed:
            update(posture)

    def say(self, text: str, tab: str | None = None) -> None:
        """Show a line of a tab on the page, unless it is closed.

        Without a name of a tab, it is the one whose callback says it.
        """
        if not self._is_closed:
            self._status.content = make_status(self._find_tab(tab), text)

    def refuse(self, problem: str, tab: str | None = None) -> None:
        """Show a problem on the page, and in its corner, unless it is closed."""
        if self._is_closed:
            return
        self.say(f"⚠ {problem}", tab)
        for client in self.server.get_clients().values():
            client.add_notification("Not done", problem, color="red", auto_close_seconds=8.0)

    def _find_tab(self, tab: str | None = None) -> str:
        """Return a tab, or else the one that is filled or whose callback runs in this thread."""
        speaking = self.tab or getattr(self._speaking, "tab", "")
        return speaking if tab is None else tab

    def add_button(
        self, label: str, work: Callable[[], None], *, main: bool = False, disabled: bool = False
    ) -> viser.GuiButtonHandle:
        """Add a button where the caller is adding elements; the ``main`` one of a tab stands out.

        Its clicks are answered as a callback.
        """
        button = self.gui.add_button(label, disabled=disabled, color=None if main else PLAIN)
        button.on_click(self.answer(work))
        return button

    def answer(self, work: Callable[[], None], tab: str | None = None) -> Callable[[object], None]:
        """Make the callback of an element, which waits for others and shows bad input.

        It speaks for a tab, by default the one that makes it.
        """
        tab = self._find_tab(tab)

        def run(_: object) -> None:
            with self._lock:
                if self._is_closed:
                    return
                before, self._speaking.tab = self._find_tab(), tab
                try:
                    with refusing():
                        work()
                except BadInputError as error:
                    self.refuse(str(error))
                except Exception as error:
                    self.refuse(f"{type(error).__name__}: {error}")
                    raise
                finally:
                    self._speaking.tab = before

        return run

    def on_change(self, element: viser.GuiInputHandle[Any], work: Callable[[], None]) -> None:
        """Answer a person's changes of an element, and not those of this program."""
        answer = self.answer(work)
        element.on_update(lambda event: answer(event) if event.client_id is not None else None)

    def run(
        self,
        work: Callable[..., Result],
        request: object,
        ended: Callable[[Result], None],
        *,
        over: Callable[[], None] = lambda: None,
    ) -> BackgroundJob[Result]:
        """Run a job, a command or a function like one, in the background; answer its end.

        ``ended`` gets its result; a job that failed or was cancelled is told on the page. ``over``
        is called at the end of any job.
        """
        tab = self._find_tab()
        job = BackgroundJob(
            work,
            request,
            report=lambda progress: self._show_progress(progress, tab),
            ended=self._conclude(ended, over),
        )
        self.jobs = [job, *(each for each in self.jobs if each.is_running)]
        return job

    def run_latest(
        self,
        work: Callable[[Request, Cancel], Result],
        ended: Callable[[Result], None],
    ) -> LatestJob[Request, Result]:
        """Prepare quick work in this process, of which only the newest request counts.

        ``ended`` gets each result, as a callback; a failure is told on the page.
        """
        job = LatestJob(work, self._conclude(ended))
        self._latest.append(job)
        return job

    def _conclude(
        self, ended: Callable[[Result], None], over: Callable[[], None] = lambda: None
    ) -> Callable[[JobEnd[Result]], None]:
        """Make what answers the end of a job in the name of the tab that begins it."""
        tab = self._find_tab()

        def conclude(end: JobEnd[Result]) -> None:
            self.answer(over, tab)(None)
            if end.cancelled:
                self.say("Cancelled.", tab)
            elif end.result is None:
                self.refuse(end.problem, tab)
            else:
                result = end.result
                self.answer(lambda: ended(result), tab)(None)

        return conclude

    def note_files(self) -> None:
        """Tell the tabs that there may be new files."""
        for update in self.when_files_changed:
            update()

    def rest(self) -> None:
        """Cancel all jobs that run, and stop to play."""
        for job in (*self.jobs, *self._latest):
            job.cancel()
        self.timeline.pause()

    def close(self) -> None:
        """Cancel all jobs, and answer no callback from now on."""
        self._is_closed = True
        self.rest()

    def _show_progress(self, progress: Progress, tab: str) -> None:
        self.say(f"{progress}" if progress.message else f"{progress} …", tab)
