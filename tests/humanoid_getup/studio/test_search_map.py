"""The map of a search shows what its archives hold, and the way to each state."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("viser", reason="needs the studio extra")

from nonempty import nonempty
from searched_robot import copy_bare_robot, search_a_little, store

from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.motions.search_motions import MotionSearch
from humanoid_getup.experiments.judging.standing import MAX_TILT
from humanoid_getup.posture_chains.discovery import ChainDiscovery
from humanoid_getup.simulation.world import World
from humanoid_getup.studio.boards.state_board import WAY_UP, MappedState, read_search_map
from robots import load_robot
from robots.robot import Robot

pytestmark = pytest.mark.studio


@pytest.fixture(scope="module")
def searched(op3: Robot, tmp_path_factory: pytest.TempPathFactory) -> tuple[World, ChainDiscovery]:
    """Return the world of a robot whose search is stored, and that search."""
    folder = copy_bare_robot(op3, tmp_path_factory.mktemp("robots"))
    world = World(load_robot(folder))
    discovery = search_a_little(world)
    store(discovery)
    return world, discovery


def read(world: World) -> list[MappedState]:
    known = read_search_map(world)
    assert known is not None
    return [*known.states]


def test_each_state_is_shown_with_the_way_that_led_to_it(searched: tuple[World, ChainDiscovery]):
    world, discovery = searched
    states = read(world)
    for each in nonempty(discovery.sides):
        shown = [state for state in states if state.side == each.side]
        filed = [*each.search.archive]
        assert len(shown) == len(filed) > 1
        for state, there in zip(shown, filed, strict=True):
            assert np.array_equal(state.qpos, [on_way.qpos for on_way in there.path])
            assert state.moves == there.depth
            assert state.kinds == tuple(move.kind for move in there.chain.moves)
            assert state.row == state.moves


def test_ways_up_lead_to_the_stance(searched: tuple[World, ChainDiscovery]):
    world, discovery = searched
    shown = [state for state in read(world) if state.side == WAY_UP]
    ups = [*discovery.tools.ways_up]
    assert len(shown) == len(ups) > 1
    for state, up in zip(shown, ups, strict=True):
        assert np.array_equal(state.qpos[state.row], up.qpos)
        assert np.array_equal(state.qpos[-1], discovery.tools.ways_up.stance.qpos)
        assert state.moves == up.depth
        assert state.neck[-1] == pytest.approx(1.0, abs=0.01)
    (stance,) = (state for state in shown if not state.moves)
    assert stance.stands
    assert stance.posture == "stand"
    assert stance.tilt < MAX_TILT


def test_a_damaged_file_or_that_of_another_robot_is_refused_in_one_line(
    searched: tuple[World, ChainDiscovery], tmp_path: Path
):
    world, _ = searched
    folder = copy_bare_robot(world.robot, tmp_path)
    toml = folder / "robot.toml"
    toml.write_text(toml.read_text("utf-8") + "# changed\n", "utf-8")
    other, sound = World(load_robot(folder)), MotionSearch.file(world.robot).read_bytes()
    file = MotionSearch.file(other.robot)
    file.parent.mkdir(exist_ok=True)
    for content, message in (
        (sound, r"made with another robot\.toml or model"),
        (sound[:-40], "damaged"),
    ):
        file.write_bytes(content)
        with pytest.raises(BadInputError, match=message) as error:
            read_search_map(other)
        assert "\n" not in str(error.value) and str(error.value).startswith(str(file))
