"""Live tab: follows a robot, stops it, reads it limp, and starts a rise where permitted."""

from __future__ import annotations

import threading
import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from drivers.live_feed.feed import find_feed, list_feeds
from drivers.live_feed.follower import LiveFollower
from drivers.live_feed.messages import FeedError, LiveSample
from humanoid_getup.jobs.follow_robot import check_robot, estimate_sample
from humanoid_getup.jobs.get_up.rise import rise
from humanoid_getup.jobs.get_up.watch import watch
from humanoid_getup.jobs.requests.rise import RiseRequest
from humanoid_getup.jobs.requests.watch import WatchRequest
from humanoid_getup.reporting.live_figures import (
    TorsoFigures,
    describe_program,
    describe_torso,
    format_degrees,
    list_joints,
)
from humanoid_getup.studio.page import PLAIN
from humanoid_getup.studio.plain_text import escape, make_table
from robots import Posture, Robot, quaternion
from robots.description.posture_file import format_posture
from robots.kinematics import imu_in_torso, place
from robots.storage.files import write_atomically

if TYPE_CHECKING:
    import viser

    from humanoid_getup.jobs.get_up.results import FinishedRise
    from humanoid_getup.progress.background_job import BackgroundJob
    from humanoid_getup.reporting.watched_robot import WatchReport
    from humanoid_getup.studio.page import Page

NO_PROGRAM: tuple[str, ...] = ("none",)
PICTURE_EVERY, TABLE_EVERY = 1.0 / 30.0, 0.2
"""Times [s] between two pictures, and between two tables of numbers, at least: a browser on the
robot's own computer takes time from its control loop."""
POLL = 0.05  # s between two looks for the feed of a job that begins
AXES = 0.25  # length of the IMU's axes, in standing neck heights
SECONDS_OF_TURN = 0.1  # s of turning that the arrow of the gyro shows
GYRO_COLOR = (230, 60, 200)
START = "start.json"
SUPPORTED = "Confirms that the robot is held and cannot fall; for one Read."
ARMED = "Permits one rise."
PINNED = {"x": -12.0, "y": 12.0, "width": 230.0}
"""Place of the second STOP, from the upper right corner of the scene [pixels]."""
HEADINGS = ("Joint", "deg", "Target", "A", "°C", "Remark")


class LiveTab:
    """Elements that follow a program and stop its robot."""

    def __init__(self, page: Page) -> None:
        """Add the elements where the caller is adding them."""
        self._page, self._tab, gui = page, page.tab, page.gui
        self._follower: LiveFollower | None = None
        self._own_follower: LiveFollower | None = None  # of the job that was started here
        self._job: BackgroundJob[Any] | None = None
        self._has_ended = False
        self._stops = 0
        self._drawn_at = self._written_at = 0.0
        self._last: LiveSample | None = None
        gui.add_button("STOP", color="red").on_click(self._stop_at_once)
        self._pinned = gui.add_panel(visible=False)
        """A second STOP over the scene, on whatever tab the page is, while a robot is followed."""
        with self._pinned.add_tab("Robot"):
            gui.add_button("STOP the robot", color="red").on_click(self._stop_at_once)
        self._pinned.float(**PINNED)
        with gui.add_folder("Program"):
            self._programs: viser.GuiDropdownHandle[str] = gui.add_dropdown("Feed", NO_PROGRAM)
            page.add_button("Refresh", self._refresh)
            page.add_button("Follow", self._follow_chosen)
            page.add_button("Leave", self._leave)
        with gui.add_folder("Robot"):
            self._add_robot(gui)
        self._numbers = gui.add_markdown("")
        self._add_imu()
        self._refresh()

    @property
    def is_following(self) -> bool:
        """Return whether a program is followed, which STOP reaches."""
        return self._follower is not None and not self._has_ended

    @property
    def last(self) -> LiveSample | None:
        """Return the sample that was received last."""
        return self._last

    def stop(self) -> None:
        """Stop the robot that is followed, and what was started here.

        The latch of the guard switches torque off; what is not followed is cancelled, which
        switches it off as well.
        """
        self._stops += 1
        if self._armed is not None:
            self._armed.value = False
        is_cancelled, problem = self._cancel_unfollowed(), ""
        try:
            if self._follower is not None:
                self._follower.stop()
            else:
                problem = "no program is followed, so no robot was stopped"
        except FeedError as error:
            problem = str(error)
        if problem and not is_cancelled:
            self._page.refuse(problem, self._tab)
        else:
            self._page.say("STOP: torque is off from the next cycle on, and stays off.", self._tab)

    def _cancel_unfollowed(self) -> bool:
        """Cancel what was started here and is not followed yet; return whether there was any."""
        own, is_followed = self._job, self._own_follower is not None
        if own is None or not own.is_running:
            return False
        if is_followed and self._follower is self._own_follower:
            return False
        own.cancel()
        return True

    async def _stop_at_once(self, _: object) -> None:
        """Stop in the server's event loop: plain callbacks wait for a free thread."""
        self.stop()

    # Following --------------------------------------------------------------------------------

    def _refresh(self) -> None:
        names = tuple(path.name for path in list_feeds())
        self._programs.options = names or NO_PROGRAM

    def _follow_chosen(self) -> None:
        path = next((p for p in list_feeds() if p.name == self._programs.value), None)
        if path is None:
            raise ValueError(
                "no program with --live runs, expected one such as: getup rise --live ..."
            )
        self.follow(path)

    def follow(self, path: Path) -> None:
        """Follow the program of a feed.

        Raises:
            ValueError: if it has ended, or its robot is another one.
        """
        self._leave()
        self._has_ended = False
        try:
            follower = LiveFollower(path, self._show, self._end)
        except FeedError as error:
            raise ValueError(str(error)) from error
        try:
            check_robot(follower, path, self._page.world.robot)
        except ValueError:
            follower.close()
            raise
        self._follower = follower
        self._pinned.visible = True
        self._page.say(f"Follows {path.name}.")

    def close(self) -> None:
        """Stop to follow."""
        self._leave()

    def _leave(self) -> None:
        if self._follower is not None:
            self._follower.close()
            self._follower = None
        self._unpin()

    def _unpin(self) -> None:
        """Hide the second STOP, unless there is something to stop."""
        is_running = self._job is not None and self._job.is_running
        self._pinned.visible = self.is_following or is_running

    def _end(self, problem: str) -> None:
        if problem:
            self._page.refuse(problem, self._tab)
        self._has_ended = True
        self._unpin()
        self._drawn_at = self._written_at = 0.0
        if self._last is not None:
            self._show(self._last)
        self._imu.visible = self._gyro.visible = False
        self._numbers.content = f"The feed has ended. Its last cycle:\n\n{self._numbers.content}"

    def _show(self, sample: LiveSample) -> None:
        """Show a sample: the robot, and from time to time its numbers."""
        goes_limp = sample.is_limp and not (self._last is not None and self._last.is_limp)
        self._last = sample
        if not np.isfinite([*sample.joint_pos, *sample.orientation]).all():
            self._page.refuse("the robot measures values that are no numbers", self._tab)
            return
        now = time.monotonic()
        if goes_limp or now - self._drawn_at >= PICTURE_EVERY:
            self._drawn_at = now
            self._draw(sample)
        if goes_limp or now - self._written_at >= TABLE_EVERY:
            self._written_at = now
            torso = TorsoFigures.of(sample, self._mounting)
            self._numbers.content = describe(sample, torso, self._page.world.robot)

    def _draw(self, sample: LiveSample) -> None:
        """Draw the robot as it measures itself."""
        world = self._page.world
        posture = estimate_sample(world, sample)
        self._page.timeline.pose(place(world.robot, world.model, posture))
        if sample.orientation and self._mounting is not None:
            self._turn_imu(posture, self._mounting, np.array(sample.gyro))

    def _add_imu(self) -> None:
        """Add the axes of the IMU, and an arrow along which the gyro measures a turn."""
        world = self._page.world
        self._mounting = imu_in_torso(world.robot, world.model) if world.robot.imu_site else None
        scene, length = self._page.server.scene, AXES * world.robot.standing_neck_height
        self._imu = scene.add_frame(
            "/imu", axes_length=length, axes_radius=0.02 * length, visible=False
        )
        self._gyro = scene.add_line_segments(
            "/gyro", np.zeros((1, 2, 3)), GYRO_COLOR, thickness=5.0, thickness_units="screen"
        )
        self._gyro.visible = False

    def _turn_imu(self, posture: Posture, mounting: np.ndarray, gyro: np.ndarray) -> None:
        position = posture.position
        turned = quaternion.multiply(posture.orientation, mounting)
        self._imu.position, self._imu.wxyz = position, turned
        arrow = quaternion.rotate(turned, gyro) * SECONDS_OF_TURN
        self._gyro.points = np.array([[position, position + arrow]], dtype=np.float32)
        self._imu.visible = self._gyro.visible = True

    # Reading and rising -----------------------------------------------------------------------

    def _add_robot(self, gui: viser.GuiApi) -> None:
        """Add what reads a limp robot, and what starts a rise if the command permits it."""
        request = self._page.request
        self._supported: viser.GuiCheckboxHandle | None = None
        if request.robot_port:
            gui.add_markdown(
                f"Robot at `{', '.join(request.robot_port)}`. *Read* switches torque **off**: a "
                "robot that stands falls, unless it is supported."
            )
            self._supported = gui.add_checkbox("Supported", False, hint=SUPPORTED)
        else:
            robot = "Servos on a virtual bus" if self._page.world.robot.bus else "The twin"
            gui.add_markdown(f"{robot}, from the posture of the page, no faster than in real time.")
        self._page.add_button("Read", self._read)
        self._add_rise(gui)
        gui.add_button("Cancel", color=PLAIN).on_click(lambda _: self._cancel())

    def _add_rise(self, gui: viser.GuiApi) -> None:
        """Add what starts a rise: on a virtual bus, or on a robot if the command permits it."""
        request = self._page.request
        self._armed: viser.GuiCheckboxHandle | None = None
        if request.robot_port and not request.allow_motion:
            gui.add_markdown("Moving this robot requires `--allow-motion`.")
            return
        if request.robot_port:
            gui.add_markdown("With *Rise* it **will move**.")
            self._armed = gui.add_checkbox("Armed", False, hint=ARMED)
        gui.add_button("Rise").on_click(self._click_rise)

    def _read(self) -> None:
        stops = self._stops
        self._check_idle()
        if self._supported is not None:
            if not self._supported.value:
                raise ValueError("the robot goes limp, expected Supported first")
            self._supported.value = False
        request = WatchRequest(**self._make_common())
        job = self._page.run(watch, request, self._conclude_reading, over=self._unpin)
        self._begin(job, stops)

    async def _click_rise(self, _: object) -> None:
        """Begin a rise, unless STOP is pressed while it waits for other callbacks."""
        begin = self._page.answer(partial(self._rise, self._stops), self._tab)
        threading.Thread(target=begin, args=(None,), daemon=True).start()

    def _rise(self, stops: int) -> None:
        page = self._page
        if stops != self._stops:
            raise ValueError("STOP was pressed after Rise, so no rise was begun")
        if self._armed is not None:
            if not self._armed.value:
                raise ValueError("the robot is not armed, expected Armed first")
            self._armed.value = False
        self._check_idle()
        then = None if page.request.robot_port else "limp"
        request = RiseRequest(**self._make_common(), attempts=1, then=then)
        self._begin(page.run(rise, request, self._conclude, over=self._unpin), stops)

    def _check_idle(self) -> None:
        """Check that nothing that was started here has the robot."""
        if self._job is not None and self._job.is_running:
            raise ValueError("the robot rises or is read, expected its end, or Cancel first")

    def _begin(self, job: BackgroundJob[Any], stops: int) -> None:
        """Follow a job as soon as it has a feed; end it if STOP was pressed since ``stops``."""
        self._job, self._own_follower = job, None
        self._pinned.visible = True
        if stops != self._stops:  # pressed while it began, and not seen by the job before
            job.cancel()
        threading.Thread(target=self._await_feed, args=(job,), daemon=True).start()

    def _make_common(self) -> dict[str, Any]:
        """Make the fields of a request for the robot, real or on a virtual bus."""
        page, given = self._page, self._page.request
        common: dict[str, Any] = {"robot": given.robot, "seed": given.seed, "live": True}
        if given.robot_port:
            return common | {"backend": "dynamixel", "port": given.robot_port}
        file = page.scratch / START
        write_atomically(file, format_posture(page.start, page.world.robot))
        backend = "virtual" if page.world.robot.bus else "twin"
        virtual = {"backend": backend, "origin": str(file)}
        return common | virtual | {"body": given.body, "scene": given.scene}

    def _await_feed(self, job: BackgroundJob[Any]) -> None:
        """Follow a job that was started here, once it has a feed."""
        while job.is_running:
            if job.pid is not None and (path := find_feed(job.pid)) is not None:
                self._page.answer(partial(self._follow_own, path), self._tab)(None)
                return
            threading.Event().wait(POLL)

    def _follow_own(self, path: Path) -> None:
        self.follow(path)
        self._own_follower = self._follower

    def _cancel(self) -> None:
        if self._job is not None:
            self._job.cancel()

    def _conclude(self, done: FinishedRise) -> None:
        self._page.say(str(done.rise))

    def _conclude_reading(self, done: WatchReport) -> None:
        self._page.say(done.reason)


def describe(sample: LiveSample, torso: TorsoFigures | None, robot: Robot) -> str:
    """Describe a sample: state of the robot, attitude, and a table of its joints."""
    rows = [
        (
            name,
            format_degrees(joint.angle_rad, 1),
            "" if joint.target_rad is None else format_degrees(joint.target_rad, 1),
            f"{joint.current_a:.2f}",
            f"{joint.temperature_c:.0f}",
            ", ".join(joint.remarks),
        )
        for name, joint in list_joints(sample, robot).items()
    ]
    lines = (escape(describe_program(sample)), escape(describe_torso(torso)))
    return "\n\n".join([*lines, make_table(HEADINGS, rows)])
