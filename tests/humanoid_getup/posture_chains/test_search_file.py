"""A search goes on from its file as if it had never ended."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from humanoid_getup.motions.motion import Motion
from humanoid_getup.posture_chains.chain_search import SearchSettings
from humanoid_getup.posture_chains.discovery import ChainDiscovery
from humanoid_getup.posture_chains.search_file import describe_search, restore_search
from humanoid_getup.simulation.world import World
from robots import Body, load_robot
from robots.storage.arrays import save_arrays

SMALL = SearchSettings(batch=6, worlds=2, threads=1)


def begin(world: World, seed: int = 3) -> ChainDiscovery:
    return ChainDiscovery(world, seed=seed, sides=("supine",), most=1, settings=SMALL)


def advance(discovery: ChainDiscovery) -> None:
    for _ in discovery.advance():
        pass


def load(name: str) -> Motion:
    raise AssertionError(f"{name}: no motion was kept")


def describe(discovery: ChainDiscovery) -> dict[str, Sequence[object]]:
    search = discovery.sides[0].search
    return {
        "states": [state.qpos.tolist() for state in search.archive],
        "ways": [[move.target.tolist() for move in state.chain.moves] for state in search.archive],
        "draws": search.archive.draws,
        "ups": [state.qpos.tolist() for state in discovery.tools.ways_up],
        "time": [discovery.simulated, discovery.sides[0].spent, search.turn],
    }


@pytest.fixture(scope="module")
def saved(world: World, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, ChainDiscovery]:
    """Return the file of a search after one round, and the search after another one."""
    discovery, path = begin(world), tmp_path_factory.mktemp("search") / "search.npz"
    advance(discovery)
    save_arrays(path, describe_search(discovery, 3))
    advance(discovery)
    return path, discovery


def test_a_restored_search_goes_on_alike(world: World, saved: tuple[Path, ChainDiscovery]):
    path, went_on = saved
    restored = begin(world)
    restore_search(path, restored, 3, load)
    assert describe(restored) != describe(went_on)
    advance(restored)
    assert describe(restored) == describe(went_on)


def test_a_search_goes_on_where_another_state_has_replaced_the_stance(world: World, tmp_path: Path):
    discovery, path = begin(world), tmp_path / "search.npz"
    ups = discovery.tools.ways_up
    squat = next(up for up in ups if up.after is ups.stance)
    assert ups.archive.add(replace(squat, cell=ups.stance.cell))
    assert not any(up is ups.stance for up in ups)
    save_arrays(path, describe_search(discovery, 3))
    restored = begin(world)
    restore_search(path, restored, 3, load)
    assert np.array_equal(restored.tools.ways_up.stance.qpos, ups.stance.qpos)
    assert all(up.root is restored.tools.ways_up.stance for up in restored.tools.ways_up)


def test_a_file_of_another_search_is_refused(world: World, saved: tuple[Path, ChainDiscovery]):
    with pytest.raises(
        ValueError, match=r"made with another seed \(3, now 4\), expected the same \(give"
    ):
        restore_search(saved[0], begin(world, seed=4), 4, load)
    longer = World(load_robot("op3", Body.parse("legs=1.1")))
    with pytest.raises(ValueError, match="made with another world, expected the same"):
        restore_search(saved[0], begin(longer), 3, load)


def test_a_damaged_file_is_refused_in_one_line(
    world: World, saved: tuple[Path, ChainDiscovery], tmp_path: Path
):
    broken = tmp_path / "broken.npz"
    broken.write_bytes(saved[0].read_bytes()[:-40])
    with pytest.raises(ValueError, match="damaged") as error:
        restore_search(broken, begin(world), 3, load)
    assert "\n" not in str(error.value)


def test_a_file_whose_states_lead_in_circles_is_refused(
    world: World, saved: tuple[Path, ChainDiscovery], tmp_path: Path
):
    with np.load(saved[0]) as arrays:
        content = dict(arrays)
    content["links"][0, 0] = 1
    save_arrays(tmp_path / "circle.npz", content)
    with pytest.raises(ValueError, match="state 0 leads to one after it"):
        restore_search(tmp_path / "circle.npz", begin(world), 3, load)


def test_a_stand_that_is_not_held_does_not_end_the_ways_up(
    world: World, saved: tuple[Path, ChainDiscovery]
):
    restored = begin(world)
    restore_search(saved[0], restored, 3, load)
    ups = restored.tools.ways_up
    before = [*ups]
    deep = max(ups, key=lambda up: up.depth)
    for steps in (deep.depth, deep.depth - 1):  # the stance, and what leads to it
        ups.drop(deep, steps)
        assert [*ups] == before
    advance(restored)


def test_a_search_for_other_sides_is_refused(world: World, saved: tuple[Path, ChainDiscovery]):
    other = ChainDiscovery(world, seed=3, sides=("prone",), most=1, settings=SMALL)
    with pytest.raises(
        ValueError, match=r"another sides \(\['supine'\], now \['prone'\]\), expected the same"
    ):
        restore_search(saved[0], other, 3, load)
