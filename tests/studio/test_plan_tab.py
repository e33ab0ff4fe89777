from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from studio_page import StudioPage, lay_down, open_studio, serve_studio
from waiting import LONGEST_WAIT, wait_until

pytest.importorskip("viser")

from humanoid_getup.motions.motion import Motion
from humanoid_getup.studio.takes import Take
from robots.kinematics import place

if TYPE_CHECKING:
    from playwright.sync_api import Browser


def plan_a_rise(studio: Any, window: StudioPage) -> None:
    lay_down(studio, "prone")
    window.open_tab("Plan")
    window.click("Plan")


def find_tabs(window: StudioPage) -> float:
    """Find how far from the top the tabs are [pixels]."""
    box = window.page.get_by_role("tab", name="Pose").bounding_box()
    assert box is not None
    return box["y"]


def test_a_fall_is_planned_played_scrubbed_and_saved(
    browser: "Browser", tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    with open_studio(browser, folder=(tmp_path,)) as (studio, window):
        height, said, say = find_tabs(window), list[tuple[str, str | None]](), studio.page.say

        def listen(text: str, tab: str | None = None) -> None:
            said.append((text, tab))
            say(text, tab)

        studio.page.say = listen
        plan_a_rise(studio, window)
        window.see("stands after")
        assert ("tracking 3 candidates in physics …", "Plan") in said
        window.see("Plan:")
        assert find_tabs(window) == height
        take = studio.page.timeline.take
        np.testing.assert_allclose(take.qpos[0, 3:7], studio.page.start.orientation, atol=0.05)
        np.testing.assert_allclose(take.ghost[0, :2], take.qpos[0, :2], atol=0.02)

        studio.page.timeline.scrub(
            0.0
        )  # the field of a take that plays changes while it is typed into
        window.see_value("Time [s]", "0")
        window.type("Time [s]", "2")
        assert studio.page.timeline.wait_for(
            lambda: np.array_equal(studio.page.timeline.picture.qpos, take.qpos[take.find(2.0)]),
            60.0,
        )
        window.click("Grab key")
        window.see("1 to rise through")
        window.click("Save")
        window.see("Saved flight.mcap, motion.npz, report.json")
        motion = Motion.load(tmp_path / "rise" / "motion.npz")
        assert motion.rises
        window.click("Copy as command")
        window.see("getup rise --from rise/start.json --out rise")


def test_the_pose_says_that_the_scene_shows_something_else_and_takes_it_over(browser: "Browser"):
    with open_studio(browser) as (studio, window):
        lay_down(studio, "prone")
        world, lying = studio.page.world, studio.page.start
        qpos = np.array([place(world.robot, world.model, p) for p in (lying, world.robot.standing)])
        take = Take(name="up", time=np.array([0.0, 1.0]), qpos=qpos)
        studio.page.timeline.load(take, play=False)
        window.see("The scene shows something else")
        window.click("Show start")
        window.page.get_by_text("The scene shows something else").wait_for(state="hidden")
        shown = studio.page.timeline.picture.qpos
        layout = world.robot.layout(world.model)
        np.testing.assert_array_equal(shown[layout.qpos], lying.joint_pos)
        window.type("Time [s]", f"{take.duration:.3f}")
        window.see("The scene shows something else")
        window.click("Take over")
        window.see("on no side")
        np.testing.assert_allclose(studio.page.start.joint_pos, take.qpos[-1, layout.qpos])


def test_a_plan_that_is_cancelled_or_whose_window_is_closed_ends_at_once(browser: "Browser"):
    with serve_studio(browser) as (studio, window):
        plan_a_rise(studio, window)
        window.see("Plan:")
        window.click("Cancel")
        window.see("Cancelled.")
        wait_until(lambda: not studio.page.is_busy)
        window.click("Plan")
        wait_until(lambda: studio.page.is_busy)
        window.page.close()
        assert all(job.wait(LONGEST_WAIT) for job in studio.page.jobs)
        assert studio.page.timeline.take is None
