import contextlib
from pathlib import Path

import numpy as np
import pytest

from humanoid_getup.experiments.drop import Drops
from humanoid_getup.policy.action import ActionSpec, choose_actions
from humanoid_getup.scenes.scene import FLAT_SCENE
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.kinematics import mirror_positions
from sim2real.environment.starts import StartPool, drop_falls
from sim2real.environment.training_world import LONGEST_DELAY, build_training_world

PHYSICS_STEP = 0.004  # s


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark every test of learning, so that `make test-train` alone runs it."""
    here = Path(__file__).parent
    for item in items:
        if item.path.is_relative_to(here) and here / "identification" not in item.path.parents:
            item.add_marker(pytest.mark.train)


@pytest.fixture(scope="session", autouse=True)
def one_torch_thread() -> None:
    """Threads of torch wait for each other longer than they compute with networks so small."""
    with contextlib.suppress(ImportError):
        import torch

        torch.set_num_threads(1)


@pytest.fixture(scope="session")
def action(op3: Robot) -> ActionSpec:
    return choose_actions(op3, wide=True)


@pytest.fixture(scope="session")
def world(op3: Robot) -> World:
    return build_training_world(op3, FLAT_SCENE, PHYSICS_STEP)


@pytest.fixture(scope="session")
def delayed_world(op3: Robot) -> World:
    return build_training_world(op3, FLAT_SCENE, PHYSICS_STEP, LONGEST_DELAY)


@pytest.fixture(scope="session")
def falls(op3: Robot, world: World) -> np.ndarray:
    """Eight settled falls and their mirror images, (16, nq)."""
    fallen = drop_falls(Drops(world, 8, threads=1), 8, np.random.default_rng(0))
    return np.concatenate([fallen, mirror_positions(op3, world.model, fallen)])


@pytest.fixture
def pool(falls: np.ndarray) -> StartPool:
    return StartPool.of(falls.copy())
