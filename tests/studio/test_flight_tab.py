"""A flight log is opened, scrubbed and examined; other files are refused in one line."""

import shlex
import shutil
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from flight_recording import record_swing, twin_of
from studio_page import StudioPage, open_studio

from drivers import Cycle
from drivers.flight_log.writer import FlightLog
from humanoid_getup.commands.main import main
from robots import Robot

if TYPE_CHECKING:
    from playwright.sync_api import Browser

MARKUP = "<img src=x> ![x](/etc/hostname) *no*"
REFUSED = {
    "noise.mcap": "not an MCAP file",
    "headless.mcap": "it does not name its robot",
    "empty.mcap": "contains no cycle, expected at least one",
    "tiny.mcap": "it is of robot 'tiny', expected 'op3'",
    "gone.mcap": "gone.mcap: No such file or directory",
    "../swing.mcap": "expected a file in",
}
EVENTS = ("phase", "over"), ("fault", MARKUP), ("ended", "attempt 1: its neck came to 0.3")


@pytest.fixture(scope="session")
def flight(op3: Robot, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A flight of OP3 whose left knee turned further than its twin's; with an event in markup."""
    knee = op3.joint_names.index("l_knee")
    off = 0.2 * (np.arange(op3.n) == knee)

    def bend(cycle: Cycle) -> Cycle:
        angles = cycle.state.joint_pos + off * (cycle.state.time > 0.4)
        return replace(cycle, state=replace(cycle.state, joint_pos=angles))

    path = tmp_path_factory.mktemp("flight") / "swing.mcap"
    record_swing(path, op3, twin_of(op3), op3.standing, bend, events=EVENTS)
    return path


@pytest.fixture
def logs(flight: Path, swing: Path, op3: Robot, tmp_path: Path) -> Path:
    """A folder with the flight, cut off and damaged ones, and those of others."""
    folder = tmp_path / "logs"
    folder.mkdir()
    for name, log in (("op3.mcap", flight), ("tiny.mcap", swing)):
        shutil.copy(log, folder / name)
    data = flight.read_bytes()
    (folder / "cut.mcap").write_bytes(data[: len(data) // 2])
    (folder / "noise.mcap").write_bytes(b"noise" * 100)
    (folder / "headless.mcap").write_bytes(data[:40])
    with FlightLog(folder / "empty.mcap", op3):
        pass
    return folder


def open_log(window: StudioPage, name: str) -> None:
    window.type("File", name)
    window.click("Open")


def test_a_flight_is_listed_opened_and_scrubbed(browser: "Browser", flight: Path, tmp_path: Path):
    with open_studio(browser, folder=(tmp_path,)) as (studio, window):
        window.open_tab("Flight")
        window.choose("Log", "no .mcap file")
        shutil.copy(flight, tmp_path / "op3.mcap")
        window.click("Refresh")
        window.choose("Log", "op3.mcap")
        window.click("Open")
        window.see("Opened ")
        timeline, take = studio.page.timeline, studio.page.timeline.take
        ended, found, *_ = take.facts
        assert ended == "Ended: attempt 1: its neck came to 0.3"
        assert found.startswith("joint 'l_knee' differed by")
        window.see("torque limit up to 1.00 N·m")
        window.see("joint 'l_knee' differed by +0.200 rad after 0.40 s")
        window.see("diverged: joint 'l_knee' differs by +0.200 rad")
        window.see("20 joints: torque limit cut by up to 0.50 N·m")
        window.see("phase: over")
        window.see(f"fault: {MARKUP}")
        assert next(iter(take.plots[0].curves)) == "l_knee", "the worst joint is the first"
        row = "l_knee 0.2000 0.1549"  # 0.2 rad for 0.6 of a second
        window.page.get_by_role("row", name=row).wait_for()

        def is_shown(seconds: float) -> bool:
            return np.array_equal(timeline.picture.qpos, take.qpos[take.find(seconds)])

        knee = studio.page.world.robot.layout(studio.page.world.model).qpos[
            studio.page.world.robot.joint_names.index("l_knee")
        ]
        for seconds, bent in ((0.3, 0.0), (0.8, 0.2)):
            window.type("Time [s]", f"{seconds}")
            assert timeline.wait_for(lambda at=seconds: is_shown(at), 60.0)
            picture = timeline.picture
            assert picture.qpos[knee] - picture.ghost[knee] == pytest.approx(bent, abs=0.001)
        thumb = window.page.get_by_role("slider").first
        thumb.press("Home")
        assert timeline.wait_for(lambda: is_shown(0.0), 60.0)


def test_the_files_are_those_of_the_command_that_is_shown(
    browser: "Browser", logs: Path, tmp_path: Path
):
    with open_studio(browser, folder=(logs,)) as (_, window):
        window.open_tab("Flight")
        window.click("Save files")
        window.see("no flight log is open")
        open_log(window, "op3.mcap")
        window.see("Opened ")
        window.type("Folder", "of the page")
        line = f"getup replay {logs}/op3.mcap --out '{logs}/of the page'"
        window.see(line)
        window.click("Save files")
        window.click("Open")
        window.see("files are being saved, expected their end, or Cancel first")
        window.see("replay.json, replay.html.")
        window.type("Folder", "../outside")
        window.click("Save files")
        window.see(f"{tmp_path}/outside: expected a file in {logs}")
    assert main([*shlex.split(line)[1:-1], str(tmp_path / "command")]) == 0
    assert not (tmp_path / "outside").exists()
    page, command = sorted((logs / "of the page").iterdir()), tmp_path / "command"
    assert [file.name for file in page] == ["replay.html", "replay.json"]
    for file in page:
        assert file.read_bytes() == (command / file.name).read_bytes()


def test_what_cannot_be_shown_is_refused_in_one_line_and_what_was_cut_off_is_shown(
    browser: "Browser", logs: Path
):
    with open_studio(browser, folder=(logs,)) as (studio, window):
        window.open_tab("Flight")
        for name, line in REFUSED.items():
            open_log(window, name)
            window.see(line)
        assert studio.page.timeline.take is None
        open_log(window, "cut.mcap")
        window.see("cut off:")
        assert 0.1 < studio.page.timeline.take.duration < 0.9
