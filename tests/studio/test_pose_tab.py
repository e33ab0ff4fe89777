from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from studio_page import open_studio

from robots import load_posture

if TYPE_CHECKING:
    from playwright.sync_api import Browser


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
