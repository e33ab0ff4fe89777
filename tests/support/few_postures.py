"""Searches over postures that begin with few of them: to draw and try all takes 20 s."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING
from unittest.mock import patch

import numpy as np
import pytest

from humanoid_getup.posture_chains import moves
from humanoid_getup.posture_chains.moves import RandomMoves
from humanoid_getup.simulation.world import World
from robots import Robot

if TYPE_CHECKING:
    from humanoid_getup.posture_chains.chain_search import ChainTools, SearchSettings

COUNT = 6  # crouches, and as many props, that are drawn


@contextmanager
def drawing_few() -> Iterator[None]:
    """Let moves be made with few crouches and props while the block runs."""
    with patch.object(moves, "CROUCHES", COUNT), patch.object(moves, "PROPS", COUNT):
        yield


@pytest.fixture(scope="module")
def few_postures() -> Iterator[None]:
    """Let all moves of a file of tests be made with few crouches and props."""
    with drawing_few():
        yield


@pytest.fixture(scope="session")
def few_moves(op3: Robot) -> RandomMoves:
    """Moves of OP3 with few crouches and props."""
    with drawing_few():
        return RandomMoves(op3, np.random.default_rng(0))


@pytest.fixture(scope="session")
def few_tools(world: World, few_moves: RandomMoves) -> ChainTools:
    """Tools of small searches with OP3."""
    from humanoid_getup.posture_chains.chain_search import ChainTools, SearchSettings

    small = SearchSettings(batch=12, worlds=2, threads=1)
    return ChainTools(world, np.random.default_rng(0), small, few_moves)


@pytest.fixture(scope="module")
def known_ways_up(few_moves: RandomMoves, few_tools: ChainTools) -> Iterator[None]:
    """Let all searches of a file of tests begin with ways up that are made once: 3 s each."""
    from humanoid_getup.motions.optimization import LIMIT_SHARES
    from humanoid_getup.posture_chains import discovery, motion_maker

    def take(_: World, rng: np.random.Generator, settings: SearchSettings, __: object):
        own = copy.copy(few_tools)
        own.settings = settings
        own = own.copy(rng)
        own.player.simulated = few_tools.player.simulated
        return own

    with pytest.MonkeyPatch.context() as changed:
        changed.setattr(discovery, "find_least_share", lambda *_: min(LIMIT_SHARES))
        for module in (discovery, motion_maker):
            changed.setattr(module, "RandomMoves", lambda *_: few_moves)
            changed.setattr(module, "ChainTools", take)
        yield
