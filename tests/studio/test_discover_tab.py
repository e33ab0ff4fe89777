"""A search is begun, followed and cancelled on the page; what it has found can be shown."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

pytest.importorskip("viser", reason="needs the studio extra")

from searched_robot import copy_bare_robot, search_a_little, store
from studio_page import StudioPage, open_studio
from waiting import wait_until

from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import find_motion
from humanoid_getup.simulation.world import World
from humanoid_getup.studio.takes import make_motion_take
from robots import Robot, load_robot
from robots.kinematics import place

if TYPE_CHECKING:
    from playwright.sync_api import Browser

FOUND = "supine_found_1"


@pytest.fixture(scope="module")
def searched(op3: Robot, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a robot that has a search and a motion which it has found."""
    folder = tmp_path_factory.mktemp("robots")
    bare = load_robot(copy_bare_robot(op3, folder))
    store(search_a_little(World(bare)))
    motion = replace(find_motion(op3, "supine_sit_up_fast"), name=FOUND)
    (bare.folder / "motions").mkdir()
    motion.save(bare.folder / "motions" / f"{FOUND}.npz")
    return folder


@pytest.fixture
def robot(searched: Path, tmp_path: Path) -> Path:
    """Return the folder of that robot, for one test to change."""
    return Path(shutil.copytree(searched / "bare", tmp_path / "bare"))


@contextmanager
def open_tab(browser: "Browser", robot: Path, folder: Path) -> Iterator[tuple[Any, StudioPage]]:
    with open_studio(browser, robot=str(robot), folder=(folder,)) as (studio, window):
        window.open_tab("Discover")
        window.see("A search is stored")
        yield studio, window


def test_a_motion_that_was_found_can_be_scrubbed(browser: "Browser", robot: Path, tmp_path: Path):
    with open_tab(browser, robot, tmp_path) as (studio, window):
        window.choose("Found", FOUND)
        window.click("Show motion")
        window.see(f"{FOUND}: ")
        assert studio.page.timeline.take.name == FOUND
        recorded = Motion.load(robot / "motions" / f"{FOUND}.npz")
        assert len(studio.page.timeline.take.time) == len(recorded.time)


@pytest.mark.parametrize(("scene", "is_told"), [("flat", False), ("rough:medium", True)])
def test_a_motion_on_other_ground_than_its_own_is_told(op3: Robot, scene: str, *, is_told: bool):
    world = World(op3, scene)
    motion = find_motion(op3, "supine_sit_up_fast")
    take = make_motion_take(world, motion, place(op3, world.model, op3.standing))
    assert any("Recorded on level ground" in fact for fact in take.facts) == is_told


def test_a_search_is_resumed_followed_and_cancelled(
    browser: "Browser", robot: Path, tmp_path: Path
):
    with open_tab(browser, robot, tmp_path) as (studio, window):
        window.click("Discover")
        window.see("made with another seed (3, now 0)")
        window.type("Seed", "3")
        window.click("Copy as command")
        window.see(f"getup motions discover --robot {robot} --resume --seed 3")
        window.click("Discover")
        window.see("squats")
        window.click("Cancel")
        window.see("Cancelled.")
        wait_until(lambda: not studio.page.is_busy)
        window.see("A search is stored")
    assert not (tmp_path / "op3_motions.png").exists()


def test_a_robot_outside_the_folders_is_not_searched(
    browser: "Browser", robot: Path, tmp_path: Path
):
    inside = tmp_path / "inside"
    inside.mkdir()
    linked = inside / "robot"
    linked.symlink_to(robot)
    with open_tab(browser, linked, inside) as (studio, window):
        window.click("Discover")
        window.see(f"{robot}: expected a robot folder within {inside}, see --folder")
        assert not studio.page.is_busy
