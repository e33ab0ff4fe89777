import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from studio_page import open_studio
from waiting import wait_until

pytest.importorskip("viser", reason="needs the studio extra")

from robots.robot import ROBOTS_FOLDER

if TYPE_CHECKING:
    from playwright.sync_api import Browser

SCENE = """\
about = "a step beside the robot"
[[boxes]]
name = "step"
center = [0, 1.5, 0.1]
size = [0.4, 0.4, 0.2]
"""


def test_robot_and_scene_are_chosen_on_the_page(browser: "Browser", tmp_path: Path):
    mine = tmp_path / "mine"
    shutil.copytree(ROBOTS_FOLDER / "toddlerbot", mine, ignore=shutil.ignore_patterns("*.npz"))
    with open_studio(browser, folder=(tmp_path,)) as (studio, window):
        window.page.get_by_text("op3, flat").click()
        window.choose("Scene", "rough:easy")
        window.type("Ground seed", "3")
        window.click("Open")
        window.see("op3, rough:easy")
        wait_until(lambda: not studio.page.world.scene.is_flat)
        assert studio.page.request.seed == 3

        window.page.get_by_text("op3, rough:easy").click()
        window.choose("Robot", "mine")
        window.choose("Scene", "flat")
        window.click("Open")
        window.see("toddlerbot, flat")
        wait_until(lambda: studio.page.world.robot.folder == mine)
        window.fall("supine")


def test_a_body_that_cannot_be_is_refused_and_the_page_stays(browser: "Browser"):
    with open_studio(browser) as (studio, window):
        page = studio.page
        window.page.get_by_text("op3, flat").click()
        window.type("Body", "wings=2")
        window.click("Open")
        window.see("wings")
        assert studio.page is page
        window.type("Body", "arms=1.2")
        window.click("Open")
        wait_until(lambda: studio.page.world.robot.body.arms == 1.2)


def test_a_scene_file_within_the_folders_is_found(browser: "Browser", tmp_path: Path):
    (tmp_path / "step.toml").write_text(SCENE)
    (tmp_path / "other.toml").write_text("[tool]\nname = 'no scene'\n")
    with open_studio(browser, folder=(tmp_path,)) as (studio, window):
        window.page.get_by_text("op3, flat").click()
        window.find_input("Scene").click()
        assert not window.page.get_by_role("option", name="other.toml").count()
        window.page.get_by_role("option", name="step.toml").click()
        window.click("Open")
        window.see("op3, step")
        wait_until(lambda: studio.page.request.scene.endswith("step.toml"))
        assert [each.name for each in studio.page.world.scene.obstacles] == ["step"]


def test_nothing_is_opened_while_a_job_runs(browser: "Browser"):
    with open_studio(browser) as (studio, window):
        page = studio.page
        window.open_tab("Plan")
        window.click("Plan")
        wait_until(lambda: page.is_busy)
        window.page.get_by_text("op3, flat").click()
        window.click("Open")
        window.see("a job is running")
        page.rest()
        wait_until(lambda: not page.is_busy)
        window.click("Open")
        wait_until(lambda: studio.page is not page)
