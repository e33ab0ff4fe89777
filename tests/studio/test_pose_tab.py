from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from studio_page import StudioPage, open_studio

from robots import load_posture
from robots.quaternion import Array

pytest.importorskip("viser")

from humanoid_getup.studio.reach import Reach

if TYPE_CHECKING:
    from playwright.sync_api import Browser

    from humanoid_getup.studio.studio import Studio

LONGEST = 60.0  # s; a wait ends with its event, this only bounds a failure


def test_a_fall_is_sampled_dropped_mirrored_and_saved(browser: "Browser", tmp_path: Path):
    with open_studio(browser, folder=(tmp_path,)) as (studio, window):
        window.choose("Class", "left")
        window.type("Seed", "3")
        window.click("Random fall")
        window.see("A fall that settled left, seed 3.")
        fallen = studio.page.start
        window.click("Mirror")
        window.see("right")
        window.type("Name", "fall.json")
        window.click("Save")
        window.see("Saved fall.json.")
        saved = load_posture(tmp_path / "fall.json", studio.page.world.robot)
        mirrored = studio.page.world.robot.mirror_joints(fallen.joint_pos)
        np.testing.assert_allclose(saved.joint_pos, mirrored, atol=1e-9)
        window.take_picture(tmp_path / "pose.png")


def test_a_file_outside_the_folders_is_neither_written_nor_read(browser: "Browser", tmp_path: Path):
    inside, outside = tmp_path / "inside", tmp_path / "outside.json"
    inside.mkdir()
    (inside / "link.json").symlink_to(outside)
    with open_studio(browser, folder=(inside,)) as (_, window):
        for name in ("../outside.json", str(outside), "link.json"):
            window.type("Name", name)
            window.click("Save")
            window.see(f"{outside}: expected a file in {inside}")
            window.click("Stand")
    assert not outside.exists()


def drag_along(studio: "Studio", window: StudioPage, way: Array) -> None:
    """Drag the gizmo by the arrow along an axis [m]; wait until it has arrived."""
    window.see("by its arrows.")
    gizmo, start = studio.page.tabs["Pose"].gizmo, studio.page.start
    handle = gizmo.shown
    grip = handle.position + 0.7 * handle.scale * np.abs(way) / np.linalg.norm(way)
    window.drag_point(studio.server, grip, grip + way)
    ended = studio.page.timeline.wait_for(
        lambda: studio.page.start is not start and not gizmo.is_held, LONGEST
    )
    assert ended


def test_a_hand_is_dragged_by_its_gizmo_and_the_other_one_mirrors_it(browser: "Browser"):
    with open_studio(browser) as (studio, window):
        robot, standing = studio.page.world.robot, studio.page.start
        window.tick("Mirrored")
        window.choose("Drag", "left_arm")
        drag_along(studio, window, np.array([0.05, 0.0, 0.0]))
        angles = studio.page.start.joint_pos
        np.testing.assert_allclose(robot.mirror_joints(angles), angles, atol=1e-9)
        arm = [robot.joint_names.index(name) for name in ("l_sho_pitch", "l_sho_roll", "l_el")]
        assert np.abs(angles - standing.joint_pos)[arm].max() > 0.1
        # The gizmo is back at the hand, wherever that came to.
        reach, shown = Reach(robot), studio.page.tabs["Pose"].gizmo.shown
        hand = reach.locate(studio.page.start, "left_arm").position
        np.testing.assert_allclose(shown.position, hand, atol=1e-4)
        assert hand[0] - reach.locate(standing, "left_arm").position[0] > 0.02


def test_a_torso_is_dragged_down_over_feet_that_stay(browser: "Browser"):
    with open_studio(browser) as (studio, window):
        reach, standing = Reach(studio.page.world.robot), studio.page.start
        window.choose("Drag", "torso")
        drag_along(studio, window, np.array([0.0, 0.0, -0.04]))
        assert studio.page.start.position[2] < standing.position[2] - 0.01
        before, after = reach.locate_soles(standing), reach.locate_soles(studio.page.start)
        for name, sole in before.items():
            np.testing.assert_allclose(after[name].position, sole.position, atol=1e-3)


def test_a_joint_is_turned_with_its_partner_and_falls_of_a_class_are_stepped_through(
    browser: "Browser",
):
    with open_studio(browser) as (studio, window):
        names = studio.page.world.robot.joint_names
        window.tick("Mirrored")
        window.page.get_by_text("Joints [deg]").click()
        window.type("l_knee", "80")
        turned = [names.index(f"{side}_knee") for side in ("l", "r")]
        arrived = np.radians([80.0, -80.0])
        studio.page.timeline.wait_for(
            lambda: np.allclose(studio.page.start.joint_pos[turned], arrived), LONGEST
        )
        np.testing.assert_allclose(studio.page.start.joint_pos[turned], arrived)
        window.type("Falls", "2")
        window.click("Random fall")
        window.see("Fall 1 of 2 that settled supine, seed 0.")
        first = studio.page.start
        window.click("Next")
        window.see("Fall 2 of 2 that settled supine, seed 0.")
        assert not np.allclose(studio.page.start.joint_pos, first.joint_pos)
        window.click("Next")
        window.see("Fall 1 of 2 that settled supine, seed 0.")
        assert studio.page.start is first
