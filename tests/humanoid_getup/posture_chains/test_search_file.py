"""A search goes on from its file as if it had never ended."""

import copy
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from humanoid_getup.motions.motion import Motion
from humanoid_getup.posture_chains.chain_search import SearchSettings
from humanoid_getup.posture_chains.discovery import ChainDiscovery
from humanoid_getup.posture_chains.search_file import (
    describe_search,
    make_recipe,
    read_search,
    restore_search,
)
from humanoid_getup.simulation.world import World
from robots import Body, load_robot
from robots.storage.arrays import save_arrays

pytestmark = pytest.mark.usefixtures("known_ways_up")

SMALL = SearchSettings(batch=6, worlds=2, threads=1)


def begin(world: World, seed: int = 3) -> ChainDiscovery:
    return ChainDiscovery(world, seed=seed, sides=("supine",), most=1, settings=SMALL)


def advance(discovery: ChainDiscovery) -> None:
    for _ in discovery.advance():
        pass


def write(path: Path, discovery: ChainDiscovery) -> None:
    recipe = make_recipe(discovery.tools.world, SMALL, ("supine",), 3)
    save_arrays(path, describe_search(discovery, recipe))


def restore(path: Path, discovery: ChainDiscovery) -> None:
    recipe = make_recipe(discovery.tools.world, SMALL, ("supine",), 3)
    restore_search(path, read_search(path, recipe), discovery, load)


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
    write(path, discovery)
    advance(discovery)
    return path, discovery


def test_a_restored_search_goes_on_alike(world: World, saved: tuple[Path, ChainDiscovery]):
    path, went_on = saved
    restored = begin(world)
    restore(path, restored)
    assert describe(restored) != describe(went_on)
    advance(restored)
    assert describe(restored) == describe(went_on)


def test_a_search_goes_on_where_another_state_has_replaced_the_stance(world: World, tmp_path: Path):
    discovery, path = begin(world), tmp_path / "search.npz"
    ups = discovery.tools.ways_up
    squat = next(up for up in ups if up.after is ups.goal)
    assert ups.archive.add(replace(squat, cell=ups.goal.cell))
    assert not any(up is ups.goal for up in ups)
    write(path, discovery)
    restored = begin(world)
    restore(path, restored)
    assert np.array_equal(restored.tools.ways_up.goal.qpos, ups.goal.qpos)
    assert all(up.root is restored.tools.ways_up.goal for up in restored.tools.ways_up)


@pytest.mark.parametrize(
    ("body", "sides", "seed", "message"),
    [
        ("", ("supine",), 4, r"another seed \(3, now 4\), expected the same \(give"),
        ("legs=1.1", ("supine",), 3, "another robot.toml or model, expected the same"),
        ("", ("prone",), 3, r"another choice of sides \(supine, now prone\)"),
    ],
)
def test_a_file_of_another_search_is_refused(body, sides, seed, message, saved):
    world = World(load_robot("op3", Body.parse(body)))
    with pytest.raises(ValueError, match=f"made with {message}"):
        read_search(saved[0], make_recipe(world, SMALL, sides, seed))


def test_a_damaged_file_is_refused_in_one_line(world, saved, tmp_path):
    broken = tmp_path / "broken.npz"
    broken.write_bytes(saved[0].read_bytes()[:-40])
    with pytest.raises(ValueError, match=r"damaged.*\(remove the file to begin again\)") as error:
        read_search(broken, make_recipe(world, SMALL, ("supine",), 3))
    assert "\n" not in str(error.value)


def test_a_file_with_a_wrong_number_is_refused_in_one_line(world, saved, tmp_path):
    with np.load(saved[0]) as arrays:
        sound = dict(arrays)
    rng, counts = json.loads(str(sound["rng"])), json.loads(str(sound["counts"]))
    circle, far, turned = sound["links"].copy(), sound["links"].copy(), sound["qpos"].copy()
    circle[0, 0], far[1, 2], turned[0, 3:7] = 1, 10_000, 0.0
    wrong = {
        "links": [(circle, "state 0 leads to one after it"), (far, "10000")],
        "members": [(np.full_like(sound["members"], -1), "without states")],
        "qpos": [(turned, "quaternion")],
        "duration": [(sound["duration"] - 9.0, "takes no time")],
        "target": [(sound["target"] + 99.0, "in the joints' ranges")],
        "progress": [(sound["progress"] + 1.0, "at most 1")],
        "cell": [(sound["cell"] + np.nan, "nan")],
        "draws": [(sound["draws"] + 0.5, "whole number")],
        "place": [(sound["place"][:, :2], "shape")],
        "chains": [(np.array([[-1, 0, 0, 0]]), "not there")],
        "rng": [(rewrite(rng, ["state", "state"], -1), "out of bounds"), ("[" * 5000, "recursion")],
        "counts": [(rewrite(counts, ["sides", 0, "spent"], -1.0), ">= 0")],
    }
    restored, file, refused = begin(world), tmp_path / "wrong.npz", list[str]()
    for key, changes in wrong.items():
        for value, message in changes:
            save_arrays(file, sound | {key: value})
            with pytest.raises(ValueError, match=message) as error:
                restore(file, restored)
            refused.append(str(error.value))
    assert len(refused) == 14
    assert all("\n" not in line and line.startswith(str(file)) for line in refused)


def rewrite(content: Any, keys: Sequence[str | int], value: object) -> str:
    changed = copy.deepcopy(content)
    inner = changed
    for key in keys[:-1]:
        inner = inner[key]
    inner[keys[-1]] = value
    return json.dumps(changed)


def test_a_stand_that_is_not_held_does_not_end_the_ways_up(world, saved):
    restored = begin(world)
    restore(saved[0], restored)
    ups = restored.tools.ways_up
    before = [*ups]
    deep = max(ups, key=lambda up: up.depth)
    for steps in (deep.depth, deep.depth - 1):  # the stance, and what leads to it
        ups.drop(deep, steps)
        assert [*ups] == before
    advance(restored)
