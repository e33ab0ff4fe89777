"""Page: what all tabs of the studio share."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from humanoid_getup.commands.errors import BadInputError, refusing
from humanoid_getup.progress.callback import CancelledError, Progress
from humanoid_getup.studio.folders import Folders
from humanoid_getup.studio.jobs import Job
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
TIMEOUT = 12.0  # s for jobs to release a robot and to end
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
        self.tabs: dict[str, Any] = {}
        """Tabs by their names."""
        self._speaking = threading.local()
        self._lock = threading.RLock()
        self._is_closed = False
        self._status = server.gui.add_html(make_status("", "Ready."))
        self.jobs: list[Job[Any, Any]] = []
        """Background work of all tabs."""

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
            self._status.content = make_status(self.speaker if tab is None else tab, text)

    def refuse(self, problem: str, tab: str | None = None) -> None:
        """Show a problem on the page, and in its corner, unless it is closed."""
        if self._is_closed:
            return
        self.say(f"⚠ {problem}", tab)
        for client in self.server.get_clients().values():
            client.add_notification("Not done", problem, color="red", auto_close_seconds=8.0)

    @property
    def speaker(self) -> str:
        """Return the tab that is filled, or whose callback runs, in this thread."""
        return getattr(self._speaking, "tab", "")

    @contextmanager
    def speaking(self, tab: str) -> Iterator[None]:
        """Let what is said or added meanwhile in this thread be of a tab."""
        before, self._speaking.tab = self.speaker, tab
        try:
            yield
        finally:
            self._speaking.tab = before

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
        tab = self.speaker if tab is None else tab

        def run(_: object) -> None:
            with self._lock, self.speaking(tab):
                if self._is_closed:
                    return
                try:
                    with refusing():
                        work()
                except BadInputError as error:
                    self.refuse(str(error))
                except Exception as error:
                    self.refuse(f"{type(error).__name__}: {error}")
                    raise

        return run

    def on_change(self, element: viser.GuiInputHandle[Any], work: Callable[[], None]) -> None:
        """Answer a person's changes of an element, and not those of this program."""
        answer = self.answer(work)
        element.on_update(lambda event: answer(event) if event.client_id is not None else None)

    def add_job(
        self,
        work: Callable[..., Result],
        ended: Callable[[Request, Result], None],
        *,
        apart: bool = True,
        busy: str = "",
    ) -> Job[Request, Result]:
        """Prepare background work, whose progress, failure and cancellation are told on the page.

        Args:
            work: A command or a function like one, done in a process of its own; or else quick work
                in this process, a function of a request and a ``cancel``.
            ended: Called with a request and its result, as a callback.
            apart: Whether it is done in a process of its own.
            busy: Problem of a request while another one runs; empty if it replaces that.
        """
        tab = self.speaker

        def conclude(request: Request, end: Result | Exception) -> None:
            if isinstance(end, CancelledError):
                self.say("Cancelled.", tab)
            elif isinstance(end, Exception):
                self.refuse(str(end) or type(end).__name__, tab)
            else:
                self.answer(lambda: ended(request, end), tab)(None)

        def show(progress: Progress) -> None:
            self.say(f"{progress}" if progress.message else f"{progress} …", tab)

        self.jobs.append(job := Job(work, conclude, show if apart else None, busy=busy))
        return job

    def add_job_buttons(self, label: str, begin: Callable[[], None], job: Job[Any, Any]) -> None:
        """Add buttons that begin and cancel work of which there is one at a time."""
        start = self.add_button(label, begin, main=True)
        cancel = self.add_button("Cancel", job.cancel, disabled=True)

        def update(is_running: bool) -> None:
            start.disabled, cancel.disabled = is_running, not is_running

        job.when_changed.append(update)

    @property
    def is_busy(self) -> bool:
        """Return whether a process works for the page."""
        return any(job.is_apart and job.is_running for job in self.jobs)

    def rest(self) -> None:
        """Cancel all jobs that run, and stop to play."""
        for job in self.jobs:
            job.cancel()
        self.timeline.pause()

    def close(self) -> None:
        """Cancel all jobs, answer no callback from now on, and stop to draw."""
        self._is_closed = True
        self.rest()
        for job in self.jobs:
            if job.is_apart:
                job.wait(TIMEOUT)
        self.timeline.close()
