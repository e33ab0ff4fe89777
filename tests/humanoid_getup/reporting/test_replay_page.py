"""The page of a replay shows the gaps of both twins, and loads nothing."""

import re

import numpy as np
import pytest
from flight_recording import record_swing, twin_of

from drivers.flight_log.reader import FlightRecord
from humanoid_getup.reporting.replay import DESCRIBED, IDENTIFIED, ReplayReport, replay, write_gaps
from humanoid_getup.reporting.replay_page import write_page
from robots import Robot
from robots.individual import Individual

MARKUP, ESCAPED = "<b>fast</b>", "&lt;b&gt;fast&lt;/b&gt;"
THRESHOLD = 0.005  # rad, which the robot as described exceeds


def with_friction(robot: Robot, factor: float) -> Robot:
    return robot.with_individual(Individual(robot=robot.name, friction=factor))


@pytest.fixture(scope="module")
def record(tiny: Robot, tmp_path_factory: pytest.TempPathFactory) -> FlightRecord:
    """A flight of a robot with four times the dry friction of its description."""
    path = tmp_path_factory.mktemp("rough") / "<b>.mcap"
    twin = twin_of(with_friction(tiny, 4.0))
    record_swing(path, tiny, twin, tiny.standing, events=[("phase", MARKUP)])
    return FlightRecord.load(path, tiny)


@pytest.fixture(scope="module")
def twins(record: FlightRecord, tiny: Robot) -> dict[str, ReplayReport]:
    robots = {DESCRIBED: tiny, IDENTIFIED: with_friction(tiny, 3.5)}
    return {
        name: replay(record, twin_of(robot), tiny.standing, threshold=THRESHOLD)
        for name, robot in robots.items()
    }


def read_rows(page: str) -> list[list[str]]:
    rows = re.findall("<tr>(.*?)</tr>", page, re.DOTALL)
    return [re.findall("<td.*?>(.*?)</td>", row) for row in rows]


def test_the_page_shows_both_gaps_and_loads_nothing(
    record: FlightRecord, twins: dict[str, ReplayReport], tiny: Robot
):
    page = write_page(record, twins, {"scene": MARKUP})
    sources = re.findall(r'(?:src|href)="(.{22})', page)
    assert set(sources) == {"data:image/png;base64,"}
    assert not re.search(r"https?:|url\(|@import|<script|<link", page)
    assert "<h1>tiny, &lt;b&gt;.mcap: robot and twin</h1>" in page
    assert page.count(ESCAPED) == 2, "event and fact"
    assert "<b>" not in page
    described, identified = twins.values()
    assert 0.0 < identified.rms.max() < 0.5 * described.rms.min(), "friction was most of the gap"
    rows = read_rows(page)
    _, *gaps = write_gaps(twins)
    for row in gaps:
        assert list(row) in rows
    share = 1.0 - np.linalg.norm(identified.rms) / np.linalg.norm(described.rms)
    assert gaps[-1][-1] == f"{share:.0%}"
    for k, name in enumerate((*tiny.joint_names, "tilt")):
        gaps = [one.gaps[span][k] for span in described.gaps for one in twins.values()]
        assert [name, *(f"{1e3 * gap:.1f}" for gap in gaps)] in rows
    shades = re.findall(r"rgb\(214 60 40/(\S+?)\)", page)
    assert max(shades) == shades[0] == "0.75", "beyond the threshold"
    assert min(shades) < "0.60"


def test_without_identified_robot_there_is_one_twin_and_no_share(
    record: FlightRecord, twins: dict[str, ReplayReport]
):
    page = write_page(record, {DESCRIBED: twins[DESCRIBED]}, {})
    assert IDENTIFIED not in page
    assert "closed" not in page
    (flight,) = [row for row in read_rows(page) if row[:1] == ["flight"]]
    assert flight[1] == f"{1e3 * twins[DESCRIBED].describe()['rms_rad']:.1f}"
