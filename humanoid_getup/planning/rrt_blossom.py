"""RRT-blossom: two trees that grow through the free space until they meet."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum, IntEnum
from typing import Protocol

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
        """Return which nodes have edges to try, (N,)."""
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


class SearchStatus(Enum):
    """How a search ended."""

    SOLVED = "reached the goal"
    START_INVALID = "the start posture violates a constraint"
    GOAL_INVALID = "the goal posture violates a constraint"
    BUDGET_SPENT = "no path within the budget"


class Problem(Protocol):
    """A space to search."""

    def distance(self, nodes: Array, x: Array) -> Array:
        """Compute the distances of nodes (N, d) from a point (d,), shape (N,)."""
        ...

    def sample(self, rng: np.random.Generator) -> Array:
        """Draw a point to grow towards, RANDOM_CONFIG, shape (d,)."""
        ...

    def steer(
        self, near: Array, target: Array, goal: Array, count: int, rng: np.random.Generator, /
    ) -> Array:
        """Take ``count`` steps from a node, SIM, shape (count, d).

        The first leads straight to the target and never beyond it, the others blossom
        around it. What has reached its value in the goal (d,) of the tree stays there.
        """
        ...

    def is_within_step(self, a: Array, b: Array) -> bool:
        """Return whether one step leads from ``a`` to ``b``."""
        ...

    def fails(self, a: Array, b: Array, /) -> bool:
        """Return whether the edge from ``a``, which is free, to ``b`` violates a constraint."""
        ...


@dataclass(frozen=True, kw_only=True)
class SearchOptions:
    """Budget and breadth of a search."""

    max_edges: int = 1500
    """Edges tried, in both trees together."""
    controls: int = 3
    """Edges that an expansion tries: straight ahead and blossoms around it."""
    edges_per_node: int = 200
    """Edges that a node may try in all its expansions."""
    goal_bias: float = 0.1
    """Share of the expansions that go to the root of the other tree."""
    is_over: Callable[[], bool] = lambda: False
    """Called before every expansion; if it returns true, the search ends without a path."""


@dataclass(frozen=True, kw_only=True)
class SearchResult:
    """Result of a search."""

    status: SearchStatus
    reason: str = ""
    """What ended the search; empty when solved."""
    nodes: int
    """Nodes in both trees."""
    edges: int
    """Edges tried."""
    path: list[Array] = field(default_factory=list)
    """From start to goal, both included; empty if there is none. One that was refined and is not
    solved still collides."""
    refined: bool = False
    """Whether it was refined from loose to strict."""


def search(
    problem: Problem,
    start: Array,
    goal: Array,
    rng: np.random.Generator,
    options: SearchOptions | None = None,
) -> SearchResult:
    """Find a path, BUILD_RRT_BLOSSOM of [Lin12], figure 2.

    Beyond the figure: the first sample is the goal, so a straight path is found at once. The
    second tree repeats its EXTEND as long as it comes closer to the first tree's new node
    (CONNECT, section 3.1). Every node added is tested against the whole other tree: with
    blossoms, the one nearest to the sample need not be the one that meets.
    """
    options = options or SearchOptions()
    trees = (Tree(start, options.edges_per_node), Tree(goal, options.edges_per_node))
    return _Search(problem, trees, rng, options).run()


def regresses(problem: Problem, tree: Tree, parent: int, leaf: Array) -> bool:
    """Return whether a leaf is closer to another node than to its parent, REGRESSION."""
    distance = problem.distance(tree.nodes, leaf)  # (N,)
    return bool(distance.min() < distance[parent])


@dataclass
class _Search:
    problem: Problem
    trees: tuple[Tree, Tree]
    rng: np.random.Generator
    options: SearchOptions
    edges: int = 0
    meeting: tuple[int, int] | None = None

    def run(self) -> SearchResult:
        a, b = 0, 1
        sample = self.trees[b].nodes[ROOT]
        self._meet(a, ROOT)
        while self.meeting is None and not self._find_end():
            new = self._extend(a, sample)
            if new is not None and self.meeting is None:
                self._connect(b, self.trees[a].nodes[new])
            a, b = b, a
            sample = self._draw(b)
        return self._result()

    def _draw(self, other: int) -> Array:
        if self.rng.random() < self.options.goal_bias:
            return self.trees[other].nodes[ROOT]
        return self.problem.sample(self.rng)

    def _connect(self, t: int, target: Array) -> None:
        """Repeat EXTEND towards a target while it comes closer."""
        tree, closest = self.trees[t], np.inf
        while self.meeting is None and not self._find_end():
            new = self._extend(t, target)
            if new is None:
                return
            distance = float(self.problem.distance(tree.nodes[new : new + 1], target)[0])
            if distance >= closest:
                return
            closest = distance

    def _extend(self, t: int, x: Array) -> int | None:
        """Grow a tree by a node towards a point, EXTEND_BLOSSOM; return it.

        Departure from the figure, which adds every edge of a blossom that is free: it ends with the
        first one, so that checks are spent on blossoms only where the straight edge fails.
        """
        tree = self.trees[t]
        near = self._choose_or_revive(t, x)
        if near is None or self.meeting is not None:  # what was revived may have met the other tree
            return near
        origin = tree.nodes[near].copy()
        goal = self.trees[1 - t].nodes[ROOT]
        count = min(self.options.controls, tree.count(near, Viability.UNTRIED))
        for leaf in self.problem.steer(origin, x, goal, count, self.rng):
            self.edges += 1
            if self.problem.fails(origin, leaf):
                tree.mark_dead(near)
            elif regresses(self.problem, tree, near, leaf):
                tree.mark_dormant(near, leaf)
            else:
                node = tree.grow(near, leaf)
                self._meet(t, node)
                return node
        return None

    def _choose_or_revive(self, t: int, x: Array) -> int | None:
        """Find the nearest node worth growing from; if none is left, revive a dormant edge."""
        tree = self.trees[t]
        candidates = tree.candidates
        if np.any(candidates):
            distance = self.problem.distance(tree.nodes, x)
            return int(np.argmin(np.where(candidates, distance, np.inf)))
        leaves = tree.dormant_leaves
        if len(leaves) == 0:
            return None
        node = tree.revive(int(np.argmin(self.problem.distance(leaves, x))))
        self._meet(t, node)
        return node

    def _meet(self, t: int, node: int) -> None:
        """Look for the other tree within one free step of a node."""
        x, other = self.trees[t].nodes[node], self.trees[1 - t]
        nearest = int(np.argmin(self.problem.distance(other.nodes, x)))
        y = other.nodes[nearest]
        if self.problem.is_within_step(x, y) and not self.problem.fails(x, y):
            self.meeting = (node, nearest) if t == 0 else (nearest, node)

    def _find_end(self) -> str:
        """Return why the search ends without a path; empty while it may continue."""
        if self.edges >= self.options.max_edges:
            return f"{self.edges} edges tried, the budget is {self.options.max_edges}"
        if self.options.is_over():
            return "the budget is spent"
        for tree, name in zip(self.trees, ("start", "goal"), strict=True):
            if not tree.is_viable:
                return f"every edge around the {name} is dead"
        return ""

    def _result(self) -> SearchResult:
        nodes = sum(tree.size for tree in self.trees)
        if self.meeting is None:
            status, reason, path = SearchStatus.BUDGET_SPENT, self._find_end(), []
        else:
            status, reason = SearchStatus.SOLVED, ""
            there, back = (
                tree.path(node) for tree, node in zip(self.trees, self.meeting, strict=True)
            )
            path = there + back[::-1]
        return SearchResult(status=status, reason=reason, nodes=nodes, edges=self.edges, path=path)
