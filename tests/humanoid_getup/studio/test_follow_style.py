"""A rise that follows a style is rolled out as `getup run` does it, again and again."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("onnxruntime")

from drivers.flight_log.reader import FlightRecord
from drivers.servo_units import ServoUnits
from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.inputs import find_start
from humanoid_getup.commands.main import main
from humanoid_getup.progress.callback import CancelledError
from humanoid_getup.simulation.world import World
from humanoid_getup.studio.follow_style import RolloutRequest, StyledRollout, StyledTwin
from humanoid_getup.style.style import Style, load_style
from humanoid_getup.style.style_editor import StyleEditor, find_rise
from robots import Posture, Robot, load_posture
from robots.description.posture_file import format_posture

NOT_AT_ONCE = 20  # cycles


@pytest.fixture(scope="module")
def twin(world: World) -> StyledTwin:
    return StyledTwin(world)


@pytest.fixture(scope="module")
def supine(world: World) -> Posture:
    return find_start(world, "supine", np.random.default_rng(0), print).posture


@pytest.fixture(scope="module")
def editor(op3: Robot) -> StyleEditor:
    return StyleEditor(op3, load_style("long-sit", op3))


@pytest.fixture(scope="module")
def rise(twin: StyledTwin, supine: Posture, editor: StyleEditor) -> StyledRollout:
    return follow(twin, supine, editor.style)


def follow(twin: StyledTwin, start: Posture, style: Style, **options) -> StyledRollout:
    request = RolloutRequest(policy="styled", start=start, style=style)
    return twin.roll_out(request, **options)


def is_same(a: StyledRollout, b: StyledRollout) -> bool:
    pairs = [(a.outcome.qpos, b.outcome.qpos), (a.wanted, b.wanted), (a.measured, b.measured)]
    return all(np.array_equal(one, other) for one, other in pairs)


@pytest.mark.usefixtures("no_film")
def test_getup_run_has_the_same_joint_path(
    op3: Robot, supine: Posture, editor: StyleEditor, tmp_path: Path
):
    style, start, out = tmp_path / "mine.toml", tmp_path / "lies.json", tmp_path / "out"
    start.write_text(format_posture(supine, op3))
    editor.shift(0.1)
    editor.save(style)
    rise = follow(StyledTwin(World(op3)), load_posture(start, op3), editor.style)
    editor.undo()
    argv = ["run", "styled", "--style", style, "--from", start, "--out", out]
    assert main([*map(str, argv)]) == 0
    flight = FlightRecord.load(out / "flight.mcap")
    count = len(rise.time)
    assert NOT_AT_ONCE < count < len(flight.time)
    guidance = flight.tracks["guidance"]
    np.testing.assert_array_equal(guidance["wanted"][:count], rise.wanted)
    np.testing.assert_array_equal(guidance["measured"][:count], rise.measured)
    angles = ServoUnits(op3).quantize(rise.outcome.record.joint_pos)
    np.testing.assert_array_equal(flight.state["joint_pos"][1:count], angles[:-1])


def test_a_kept_twin_rises_the_same_again_also_after_one_that_was_cancelled(
    twin: StyledTwin, supine: Posture, editor: StyleEditor, rise: StyledRollout
):
    cycles = iter(range(100))
    with pytest.raises(CancelledError):
        follow(twin, supine, editor.style, cancel=lambda: next(cycles) > NOT_AT_ONCE)
    assert next(cycles) == NOT_AT_ONCE + 2
    assert is_same(rise, follow(twin, supine, editor.style))


def test_a_later_rise_of_the_curves_is_a_later_rise_of_the_robot(
    twin: StyledTwin, supine: Posture, editor: StyleEditor, rise: StyledRollout
):
    editor.last(1.3 * editor.curves.duration)
    slower = follow(twin, supine, editor.style)
    editor.shift(0.4)
    later = follow(twin, supine, editor.style)
    editor.undo()
    editor.undo()
    assert not is_same(rise, slower)
    times = [find_rise(run.time, run.measured[:, 0]) for run in (rise, slower, later)]
    assert times[0] + 0.2 < times[1]
    assert times[1] + 0.2 < times[2] < times[1] + 0.6


def test_a_policy_that_follows_none_is_refused(twin: StyledTwin, supine: Posture, editor):
    with pytest.raises(BadInputError, match="policy 'quick' follows no style curves"):
        twin.roll_out(RolloutRequest(policy="quick", start=supine, style=editor.style))
