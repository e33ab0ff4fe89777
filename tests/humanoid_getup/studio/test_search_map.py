"""The map of a search shows what its archives hold, and the way to each state."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("viser", reason="needs the studio extra")

from nonempty import nonempty
from searched_robot import copy_bare_robot, search_a_little, store

from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.motions.search_motions import MotionSearch
from humanoid_getup.experiments.judging.standing import MAX_TILT
from humanoid_getup.posture_chains.discovery import ChainDiscovery
from humanoid_getup.posture_chains.stored_states import STATES
from humanoid_getup.simulation.world import World
from humanoid_getup.studio.boards.state_board import WAY_UP, MappedState, read_search_map
from robots import load_robot
from robots.robot import Robot
from robots.storage.arrays import save_arrays

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


def test_a_damaged_file_is_refused_in_one_line(searched: tuple[World, ChainDiscovery]):
    world, _ = searched
    file = MotionSearch.file(world.robot)
    sound = file.read_bytes()
    with np.load(file) as arrays:
        content = dict(arrays)
    turned = content["qpos"].copy()
    turned[0, 3:7] = 0.0
    wrong = {
        "members": (np.full_like(content["members"], 10_000), "10000"),
        "qpos": (turned, "quaternion"),
        "links": (content["links"] + 10_000, "links holds"),
        "recipe": ("[]", "expected a table"),
        "counts": ("{}", "missing required field"),
    }
    recipe = json.loads(str(content["recipe"]))
    changes = [({key: value}, message) for key, (value, message) in wrong.items()]
    changes += [
        ({"recipe": json.dumps(recipe | {"seed": 2**70})}, "seed"),
        ({"recipe": json.dumps(recipe | {"torque limit": "nan N·m"})}, "limit"),
        (make_long_way(content), "over 300 moves long"),
    ]
    refused = list[str]()
    for change, message in changes:
        save_arrays(file, content | change)
        with pytest.raises(BadInputError, match=message) as error:
            read_search_map(world)
        refused.append(str(error.value))
    file.write_bytes(sound[:-40])
    with pytest.raises(BadInputError, match="damaged") as error:
        read_search_map(world)
    refused.append(str(error.value))
    file.write_bytes(sound)
    assert len(refused) == 9
    assert all("\n" not in line and line.startswith(str(file)) for line in refused)
    assert read_search_map(world) is not None


def make_long_way(content: dict[str, Any]) -> dict[str, Any]:
    """Make the states of a chain that leads through the same posture again and again."""
    count = 400
    states = {key: np.repeat(content[key][:1], count, axis=0) for key in STATES}
    links = np.full((count, 4), -1)
    links[1:, 0] = np.arange(count - 1)
    return states | {"links": links}


def test_a_file_of_another_robot_is_refused(searched: tuple[World, ChainDiscovery], tmp_path: Path):
    world, _ = searched
    folder = copy_bare_robot(world.robot, tmp_path)
    toml = folder / "robot.toml"
    toml.write_text(toml.read_text("utf-8") + "# changed\n", "utf-8")
    other = World(load_robot(folder))
    MotionSearch.file(other.robot).parent.mkdir(exist_ok=True)
    MotionSearch.file(other.robot).write_bytes(MotionSearch.file(world.robot).read_bytes())
    with pytest.raises(BadInputError, match=r"made with another robot\.toml or model"):
        read_search_map(other)
