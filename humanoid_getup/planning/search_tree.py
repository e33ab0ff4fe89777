"""A search tree whose edges store whether the space behind them is exhausted."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from robots.quaternion import Array

ROOT = 0


class Viability(IntEnum):
    """State of an edge, figure 4 of [Lin12]; also of the node it leads to."""

    UNTRIED = 0
    """Not yet considered."""
    LIVE = 1
    """In the tree, with space to search behind it."""
    DORMANT = 2
    """Not in the tree because it regresses, or with only such edges behind it."""
    DEAD = 3
    """It collides, or has only such edges behind it."""


class Tree:
    """Nodes, their parents, and the viability of their edges.

    A node has a fixed number of edges to try. When all are tried and none is live, the
    node is dormant, or dead if none of its edges is dormant, and so is the edge that leads
    to it: the state propagates towards the root up to the first live node.
    """

    def __init__(self, root: Array, edges_per_node: int) -> None:
        self.edges_per_node = edges_per_node
        self.size = 0
        self._nodes = np.empty((64, len(root)))
        self._parent = np.empty(64, dtype=np.intp)
        self._growable = np.empty(64, dtype=bool)
        self._state: list[Viability] = []
        self._edges: list[list[int]] = []
        self._dormant: list[int] = []  # parents of the dormant leaves
        self._leaves = np.empty((64, len(root)))
        self._append(root, parent=-1)

    def __len__(self) -> int:
        return self.size

    @property
    def candidates(self) -> NDArray[np.bool_]:
        """Return which nodes are worth growing from: live, with edges untried, (N,)."""
        return self._growable[: self.size]

    @property
    def is_viable(self) -> bool:
        """Return whether there is a node to grow from or an edge to revive."""
        return bool(self._dormant) or bool(np.any(self.candidates))

    @property
    def dormant_leaves(self) -> Array:
        """Return the far ends of the dormant edges that never entered the tree, (D, d)."""
        return self._leaves[: len(self._dormant)]

    def parent(self, node: int) -> int:
        """Return the parent of a node, -1 for the root."""
        return int(self._parent[node])

    def state(self, node: int) -> Viability:
        """Return the viability of the edge that leads to a node."""
        return self._state[node]

    def count(self, node: int, state: Viability) -> int:
        """Count the edges of a node that are in a state."""
        return self._edges[node][state]

    def grow(self, node: int, leaf: Array) -> int:
        """Take an edge into the tree; return the new node."""
        self._spend(node, Viability.LIVE)
        return self._append(leaf, node)

    def mark_dormant(self, node: int, leaf: Array) -> None:
        """Mark an edge that regresses; it may be revived."""
        self._spend(node, Viability.DORMANT)
        if len(self._dormant) == len(self._leaves):
            self._leaves = _doubled(self._leaves)
        self._leaves[len(self._dormant)] = leaf
        self._dormant.append(node)
        self._propagate(node)

    def mark_dead(self, node: int) -> None:
        """Mark an edge that fails."""
        self._spend(node, Viability.DEAD)
        self._propagate(node)

    def revive(self, index: int) -> int:
        """Take a row of `dormant_leaves` into the tree; return the new node."""
        node, leaf = self._dormant[index], self._leaves[index].copy()
        self._leaves[index] = self._leaves[len(self._dormant) - 1]  # the last fills the gap
        self._dormant[index] = self._dormant[-1]
        self._dormant.pop()
        self._edges[node][Viability.DORMANT] -= 1
        self._edges[node][Viability.LIVE] += 1
        self._propagate(node)
        return self._append(leaf, node)

    def path(self, node: int) -> list[Array]:
        """Return the nodes from the root to ``node``."""
        branch: list[Array] = []
        while node >= 0:
            branch.append(self._nodes[node].copy())
            node = self.parent(node)
        return branch[::-1]

    def _spend(self, node: int, state: Viability) -> None:
        self._edges[node][Viability.UNTRIED] -= 1
        self._edges[node][state] += 1
        self._growable[node] = self._edges[node][Viability.UNTRIED] > 0

    def _propagate(self, node: int) -> None:
        """Update a node's state from those of its edges, and its parents as far as it changes."""
        while node >= 0:
            edges = self._edges[node]
            if edges[Viability.UNTRIED] > 0 or edges[Viability.LIVE] > 0:
                state = Viability.LIVE
            else:
                state = Viability.DORMANT if edges[Viability.DORMANT] > 0 else Viability.DEAD
            before = self._state[node]
            if state == before:
                return
            self._state[node] = state
            node = self.parent(node)
            if node >= 0:
                self._edges[node][before] -= 1
                self._edges[node][state] += 1

    def _append(self, node: Array, parent: int) -> int:
        if self.size == len(self._nodes):
            self._nodes, self._parent = _doubled(self._nodes), _doubled(self._parent)
            self._growable = _doubled(self._growable)
        row = self.size
        self._nodes[row] = node
        self._parent[row] = parent
        self._growable[row] = True
        self._state.append(Viability.LIVE)
        self._edges.append([self.edges_per_node, 0, 0, 0])
        self.size += 1
        self.nodes = self._nodes[: self.size]
        """The nodes, (N, d)."""
        return row


def _doubled(rows: np.ndarray) -> np.ndarray:
    return np.concatenate([rows, np.empty_like(rows)])
