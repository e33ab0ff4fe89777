from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from studio_page import StudioPage, open_studio

from humanoid_getup.motions.motion import Motion

if TYPE_CHECKING:
    from playwright.sync_api import Browser


def plan_a_rise(window: StudioPage) -> None:
    window.fall("prone")
    window.open_tab("Plan")
    window.click("Plan")


def test_a_fall_is_planned_played_scrubbed_and_saved(browser: "Browser", tmp_path: Path):
    with open_studio(browser, folder=(tmp_path,)) as (studio, window):
        plan_a_rise(window)
        window.see("stands after")
        take = studio.timeline.take
        np.testing.assert_allclose(take.qpos[0, 3:7], studio.page.start.orientation, atol=0.05)
        np.testing.assert_allclose(take.ghost[0, :2], take.qpos[0, :2], atol=0.02)

        window.type("Time [s]", "2")
        assert studio.timeline.wait_for(
            lambda: np.array_equal(studio.timeline.picture.qpos, take.qpos[take.find(2.0)]), 60.0
        )
        window.click("Grab key")
        window.see("1 to rise through")
        window.click("Save")
        window.see("Saved flight.mcap, motion.npz, report.json")
        motion = Motion.load(tmp_path / "rise" / "motion.npz")
        assert motion.rises
        window.click("Copy as command")
        window.see(f"getup rise --from {tmp_path}/rise/start.json --out {tmp_path}/rise")


def test_a_plan_that_is_cancelled_ends_at_once(browser: "Browser"):
    with open_studio(browser) as (studio, window):
        plan_a_rise(window)
        window.see("planning")
        window.click("Cancel")
        window.see("Cancelled.")
        assert studio.timeline.take is None
        assert not any(job.is_running for job in studio.page.jobs)


def test_a_window_that_is_closed_ends_what_it_began(browser: "Browser"):
    with open_studio(browser) as (studio, window):
        plan_a_rise(window)
        window.see("planning")
        (job,) = studio.page.jobs
        window.page.close()
        end = job.wait(60.0)
        assert end is not None
        assert end.cancelled
