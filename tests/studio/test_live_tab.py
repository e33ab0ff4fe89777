import os
import signal
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from studio_page import open_studio
from waiting import wait_until

if TYPE_CHECKING:
    from playwright.sync_api import Browser


@pytest.fixture(autouse=True)
def own_feeds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path))  # of the processes that rise


def test_stop_in_a_live_rise_on_the_virtual_bus_switches_torque_off(browser: "Browser"):
    with open_studio(browser) as (studio, window):
        window.fall("prone")
        window.open_tab("Live")
        window.click("Rise")
        live = studio.tabs["Live"]
        wait_until(lambda: live.last is not None and not live.last.is_limp)
        (job,) = studio.page.jobs
        os.kill(job.pid, signal.SIGSTOP)  # a slow browser must not miss the end of the rise
        window.see("playing")
        window.open_tab("Pose")
        window.click("STOP the robot")
        os.kill(job.pid, signal.SIGCONT)
        window.open_tab("Live")
        window.see("torque off")
        window.see("stopped from the live page")
        assert live.last.is_limp


def test_a_limp_robot_is_read_until_it_is_cancelled(browser: "Browser", tmp_path: Path):
    with open_studio(browser) as (studio, window):
        window.fall("prone")
        window.open_tab("Live")
        window.click("Read")
        window.see("watching, ")
        window.see("torso on its belly")
        live = studio.tabs["Live"]
        assert live.last.is_limp
        window.click("Rise")
        window.see("the robot rises or is read, expected its end, or Cancel first")
        window.take_picture(tmp_path / "read.png")
        window.click("Cancel")
        window.see("The feed has ended.")
        wait_until(lambda: not any(job.is_running for job in studio.page.jobs))
        assert len(studio.page.jobs) == 1


def test_stop_ends_what_is_not_followed_yet(browser: "Browser"):
    with open_studio(browser) as (studio, window):
        window.open_tab("Live")
        live = studio.tabs["Live"]
        live.follow = lambda _: None
        window.click("Read")
        wait_until(lambda: any(job.is_running for job in studio.page.jobs))
        window.click("STOP")
        window.see("Cancelled.")
        wait_until(lambda: not any(job.is_running for job in studio.page.jobs))


def test_stop_while_a_rise_begins_is_not_lost(browser: "Browser"):
    with open_studio(browser) as (studio, window):
        window.fall("prone")
        window.open_tab("Live")
        live, run = studio.tabs["Live"], studio.page.run

        def run_after_stop(*arguments: Any, **options: Any) -> Any:
            live.stop()
            return run(*arguments, **options)

        studio.page.run = run_after_stop
        window.click("Rise")
        window.see("Cancelled.")
        assert not live.last
        wait_until(lambda: not any(job.is_running for job in studio.page.jobs))


def test_a_port_without_a_robot_is_told_in_one_line(browser: "Browser"):
    with open_studio(browser, robot_port=("/dev/null",)) as (_, window):
        window.open_tab("Live")
        for _ in range(2):  # what was checked is for one reading
            window.click("Read")
            window.see("the robot goes limp, expected Supported first")
            window.tick("Supported")
            window.click("Read")
            window.see("port /dev/null")


def test_stop_without_a_robot_says_so(browser: "Browser"):
    with open_studio(browser) as (_, window):
        window.open_tab("Live")
        window.click("STOP")
        window.see("no program is followed, so no robot was stopped")
        window.click("Follow")
        window.see("no program with --live runs")


def test_a_robot_moves_only_where_the_command_allows_it_and_when_it_is_armed(browser: "Browser"):
    with open_studio(browser, robot_port=("/dev/null",)) as (_, window):
        window.open_tab("Live")
        window.see("Moving this robot requires")
        assert window.page.get_by_role("button", name="Rise", exact=True).count() == 0
    with open_studio(browser, robot_port=("/dev/null",), allow_motion=True) as (studio, window):
        window.open_tab("Live")
        window.click("Rise")
        window.see("the robot is not armed")
        assert studio.page.jobs == []
        assert "?token=" in studio.address  # which other users of this machine do not know
