"""Measures the studio: first picture, scrubbing, memory, edited curves.

    python benchmarks/studio.py --n 20 --scrubs 10000 --json studio.json

A headless Chromium is the browser, which draws in software where there is no GPU.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from json import dumps
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from playwright.sync_api import Browser, Page, sync_playwright

from humanoid_getup.commands.get_up.play import PlayRequest, play_motion
from humanoid_getup.commands.look.studio import StudioRequest
from humanoid_getup.experiments.falls import sample_fall
from humanoid_getup.simulation.world import World
from humanoid_getup.studio.follow_style import RolloutRequest, StyledTwin
from humanoid_getup.studio.studio import Studio
from humanoid_getup.studio.takes import make_rise_take
from humanoid_getup.style.style import load_style
from humanoid_getup.style.style_editor import StyleEditor
from robots import load_robot

GETUP = [sys.executable, "-m", "humanoid_getup.commands.main"]
MOTION, SIDE = "prone_push_up_gentle", "prone"
CHROMIUM = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
TIMEOUT = 60.0  # s
POLL = 0.005  # s
POINT = 6  # control point of the neck height that is edited, counted from 0


@dataclass(frozen=True)
class Options:
    """Options of the benchmark."""

    n: int = 20
    """Number of starts."""
    scrubs: int = 10_000
    """Number of times that are scrubbed to."""
    json: Path | None = None


def main(options: Options) -> None:
    """Measure and print."""
    with sync_playwright() as play:
        browser = play.chromium.launch(
            executable_path=shutil.which("chromium"), args=list(CHROMIUM)
        )
        figures = {
            **_time_openings(browser, options.n),
            **_measure_scrubbing(browser, options.scrubs),
            "edited_curve_s": summarize(_time_edits(options.n)),
        }
    print(dumps(figures, indent=1))
    if options.json is not None:
        options.json.write_text(dumps(figures, indent=1))


def summarize(values: list[float]) -> dict[str, float]:
    """Return median and 95th percentile."""
    return {
        "n": len(values),
        "median": round(float(np.median(values)), 4),
        "p95": round(float(np.percentile(values, 95)), 4),
    }


def _time_openings(browser: Browser, n: int) -> dict[str, Any]:
    """Time from the start of the command to its address, and to the first picture [s]."""
    served, shown = zip(*(_time_opening(browser) for _ in range(n)), strict=True)
    return {"address_s": summarize([*served]), "first_picture_s": summarize([*shown])}


def _time_opening(browser: Browser) -> tuple[float, float]:
    """Time from the start of the command to its address and to a picture with the robot [s]."""
    began = time.perf_counter()
    with subprocess.Popen(
        [*GETUP, "studio", "--port", "0"], stdout=subprocess.PIPE, text=True
    ) as studio:
        assert studio.stdout is not None
        address = studio.stdout.readline().strip()
        served = time.perf_counter() - began
        page = browser.new_page()
        page.goto(address)
        _wait_for_page(page)
        shown = time.perf_counter() - began
        page.close()
        studio.terminate()
    return served, shown


def _wait_for_page(page: Page) -> None:
    page.get_by_text("Random fall").wait_for()
    page.locator("canvas").first.wait_for()


@contextmanager
def _open(browser: Browser) -> Iterator[tuple[Studio, Page]]:
    with Studio(StudioRequest(port=0)) as studio:
        page = browser.new_page()
        page.goto(studio.address)
        _wait_for_page(page)
        yield studio, page
        page.close()


def _measure_scrubbing(browser: Browser, scrubs: int) -> dict[str, Any]:
    """Scrub through a rise as fast as pictures are drawn, with a page open."""
    finished = play_motion(PlayRequest(motion=MOTION))
    with _open(browser) as (studio, _):
        take = make_rise_take(studio.page.world, finished.rise, "rise")
        assert take is not None
        timeline = studio.page.timeline
        timeline.load(take, play=False)
        rng, before = np.random.default_rng(0), 0
        took = list[float]()
        for scrub in range(scrubs):
            if scrub == scrubs // 10:
                before = _read_memory()
            drawn, began = timeline.pictures, time.perf_counter()
            timeline.scrub(float(rng.uniform(0.0, take.duration)))
            timeline.wait_for(lambda drawn=drawn: timeline.pictures > drawn, TIMEOUT)
            took.append(time.perf_counter() - began)
        return {
            "pictures_per_s": round(scrubs / sum(took), 1),
            "picture_s": summarize(took),
            "memory_grown_mib": round((_read_memory() - before) / 1024, 1),
        }


def _time_edits(n: int) -> list[float]:
    """Time from an edited curve to the rise that follows it [s], from one fall on the back."""
    world = World(load_robot("op3"))
    start, style = sample_fall(world, "supine").posture, load_style("side-sit", world.robot)
    twin, editor, took = StyledTwin(world), StyleEditor(world.robot, style), list[float]()
    for edit in range(n + 1):
        editor.change(editor.move_point(0, POINT, 0.3 + 0.01 * (edit % 10)))
        began = time.perf_counter()
        twin.roll_out(RolloutRequest(policy="styled", start=start, style=editor.style))
        took.append(time.perf_counter() - began)
    return took[1:]  # the first one loads the policy and lets the robot settle


def _read_memory() -> int:
    """Read the resident memory of this process [KiB]."""
    found = re.search(r"VmRSS:\s+(\d+)", Path("/proc/self/status").read_text())
    assert found is not None
    return int(found[1])


if __name__ == "__main__":
    main(tyro.cli(Options))
