"""Shortcuts: moves straight to later postures of a chain, where they lead there as well."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from itertools import combinations

import numpy as np

from humanoid_getup.experiments.disturbances.disturbance import Scenarios
from humanoid_getup.posture_chains.move_player import STANDS, MovePlayer
from humanoid_getup.posture_chains.moves import RandomMoves
from humanoid_getup.posture_chains.resting_state import PostureChain, PostureMove, RestingState

SHORTCUT_TIME = 0.8  # s for OP3
ATTEMPTS = 3  # at a way on which a whole rise stands

Step = tuple[int, int]
"""From one state of a chain to a later one, by their numbers."""
Edges = dict[Step, PostureMove]


class ShortcutFinder:
    """Finds the quickest way along a chain: single moves are tried, not whole rises."""

    def __init__(self, player: MovePlayer, moves: RandomMoves, worlds: int) -> None:
        """Prepare; a shortcut leads to its posture in some disturbed worlds, as other moves do."""
        self._player, self._moves, self._worlds = player, moves, worlds

    def shorten(self, chain: PostureChain, scenarios: Scenarios) -> PostureChain:
        """Return the quickest chain with shortcuts that stands in scenarios of its start.

        It falls in no more of them than the chain, or in one; without shortcuts, the chain itself.
        """
        states = self._player.trace(chain)
        edges: Edges = {(k, k + 1): move for k, move in enumerate(chain.moves)}
        found = self._find_shortcuts(states)
        for _ in range(ATTEMPTS):
            way = self._find_quickest(len(states), edges | found)
            if not any(step in found for step in way):
                break
            last = _link(states, way, edges | found)
            followed = self._player.follow([last], scenarios)
            missed, fallen = int(followed.lost[0]), int(followed.fallen[0])
            if missed == STANDS and fallen <= max(chain.fallen, 1):
                return replace(last.chain, fallen=fallen)
            led_there = way if missed == STANDS else way[:missed]
            wrong = [step for step in led_there if step in found]
            if not wrong:
                break
            del found[wrong[-1]]
        return chain

    def _find_shortcuts(self, states: list[RestingState]) -> Edges:
        """Find the moves that skip postures, and lead to where the chain does."""
        time, player = SHORTCUT_TIME * self._player.scale, self._player
        pairs = [(i, j) for i, j in combinations(range(len(states)), 2) if j > i + 1]
        direct = {
            (i, j): self._moves.aim(states[i].target, states[j].target, time, "shortcut")
            for i, j in pairs
        }
        for play in (player.try_out, partial(player.check, worlds=self._worlds)):
            if not pairs:
                break
            begun, goals = [states[i] for i, _ in pairs], [states[j] for _, j in pairs]
            leads = play(begun, [direct[pair] for pair in pairs]).are_like(goals)
            pairs = [pair for pair, does in zip(pairs, leads, strict=True) if does]
        return {pair: direct[pair] for pair in pairs}

    def _find_quickest(self, count: int, edges: Edges) -> list[Step]:
        """Find the quickest way from the first state to the last, with a rest after each move."""
        time, before = [0.0] + [np.inf] * (count - 1), [0] * count
        for (i, j), move in sorted(edges.items()):
            arrives = time[i] + move.duration + self._player.rest
            if arrives < time[j]:
                time[j], before[j] = arrives, i
        way, state = list[Step](), count - 1
        while state:
            way.append((before[state], state))
            state = before[state]
        return way[::-1]


def _link(states: list[RestingState], way: list[Step], edges: Edges) -> RestingState:
    """Link states along a way; return the last."""
    last = states[0]
    for depth, step in enumerate(way, start=1):
        last = replace(states[step[1]], before=last, move=edges[step], depth=depth)
    return last
