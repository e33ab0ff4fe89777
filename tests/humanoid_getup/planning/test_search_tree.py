"""Edges die, sleep and wake, and their nodes with them."""

import numpy as np

from humanoid_getup.planning.search_tree import ROOT, Tree, Viability


def branch() -> tuple[Tree, list[int]]:
    """Grow root - 1 - 2 - 3 with two edges a node, the second of each dead."""
    tree = Tree(np.zeros(2), edges_per_node=2)
    nodes = [ROOT]
    for k in range(1, 4):
        nodes.append(tree.grow(nodes[-1], np.array([float(k), 0.0])))
        tree.mark_dead(nodes[-2])
    return tree, nodes


def test_death_recedes_to_the_root():
    tree, nodes = branch()
    tree.mark_dead(nodes[3])
    assert tree.state(nodes[3]) is Viability.LIVE  # one edge is untried
    tree.mark_dead(nodes[3])
    assert [tree.state(node) for node in nodes] == [Viability.DEAD] * 4
    assert not tree.is_viable


def test_death_stops_at_a_node_with_another_live_edge():
    tree = Tree(np.zeros(2), edges_per_node=2)
    left, right = tree.grow(ROOT, np.array([-1.0, 0.0])), tree.grow(ROOT, np.array([1.0, 0.0]))
    tree.mark_dead(left)
    tree.mark_dead(left)
    assert tree.state(left) is Viability.DEAD
    assert tree.state(ROOT) is Viability.LIVE
    assert tree.candidates.tolist() == [False, False, True]
    assert tree.count(ROOT, Viability.DEAD) == 1
    assert tree.state(right) is Viability.LIVE


def test_one_dormant_edge_makes_a_branch_sleep_and_wakes_it_when_revived():
    tree, nodes = branch()
    tree.mark_dead(nodes[3])
    leaf = np.array([4.0, 0.0])
    tree.mark_dormant(nodes[3], leaf)
    assert [tree.state(node) for node in nodes] == [Viability.DORMANT] * 4
    assert not tree.candidates.any()
    assert tree.is_viable
    woken = tree.revive(0)
    assert [tree.state(node) for node in [*nodes, woken]] == [Viability.LIVE] * 5
    assert tree.candidates.tolist() == [False] * 4 + [True]
    assert len(tree.dormant_leaves) == 0
    tree.mark_dead(woken)
    tree.mark_dead(woken)
    assert [tree.state(node) for node in nodes] == [Viability.DEAD] * 4


def test_a_path_leads_from_the_root_and_survives_growth():
    tree = Tree(np.zeros(1), edges_per_node=1)
    node = ROOT
    for k in range(1, 200):
        node = tree.grow(node, np.array([float(k)]))
    np.testing.assert_array_equal(np.array(tree.path(node))[:, 0], np.arange(200))
    assert len(tree) == 200
    assert tree.candidates.sum() == 1
