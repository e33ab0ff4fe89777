"""The maker's keyframes as a peer; skipped without them."""

import numpy as np
import pytest
from benchmark_scripts import load_script
from paths import SHARED

from robots import TorqueLimit

PEERS = SHARED / "peers"
pytestmark = pytest.mark.skipif(not PEERS.exists(), reason="needs the maker's pages in ../shared")


@pytest.fixture(scope="module")
def peer():
    return load_script("peer_keyframes")


@pytest.mark.parametrize("number", [122, 123])
def test_a_page_passes_its_postures_on_time_and_rests_in_its_pauses(peer, op3, number):
    page, step = peer.Page.load(PEERS, number, op3), 1e-6
    targets = page.begin_at(np.zeros(op3.n))
    np.testing.assert_allclose(targets(0.0), np.zeros(op3.n))
    np.testing.assert_allclose(targets(page.time), page.joint_pos, atol=1e-12)
    for time in (0.0, page.time[-1]):  # begins and ends at rest
        speed = (targets(time + step) - targets(time)) / step
        assert np.abs(speed).max() < 1e-3
    pauses = np.flatnonzero(np.all(np.diff(page.joint_pos, axis=0) == 0.0, axis=1))
    assert len(pauses) > 0
    for k in pauses:
        during = targets(np.linspace(page.time[k], page.time[k + 1], 5))
        np.testing.assert_allclose(during, np.broadcast_to(page.joint_pos[k], during.shape))


def test_a_joint_that_keeps_its_direction_does_not_stop_at_a_step(peer):
    page = peer.Page(time=np.array([1.0, 2.0]), joint_pos=np.array([[1.0, 1.0], [2.0, 0.0]]))
    targets = page.begin_at(np.zeros(2))
    speed = (targets(1.001) - targets(0.999)) / 0.002
    assert speed[0] == pytest.approx(1.0, abs=0.01)  # goes on
    assert speed[1] == pytest.approx(0.0, abs=0.01)  # reverses


@pytest.mark.slow  # half a minute
def test_all_get_up_from_the_same_falls_under_the_same_limit(peer, world):
    records = []
    limits = {"3 N·m by PWM": TorqueLimit(3.0, "pwm")}
    result = peer.compare(world, PEERS, seed=4, each=1, limits=limits, report=records.append)
    assert list(result["limits"]) == list(limits)
    starts = [rise.start_class for rise in records]
    assert len(starts) == 12
    assert starts[:3] * 4 == starts
    ways = result["limits"]["3 N·m by PWM"]
    assert list(ways) == [peer.PLANNED, peer.ROBUST, peer.GENTLE, peer.PEER]
    for case in ways.values():
        assert case["n"] == 3
        assert case["stood"] == sum(case["stood_by_class"].values())
        assert case["stood"] + len(case["failures"]) == 3
    assert ways[peer.PEER]["not_played"] == 0
    assert ways[peer.PEER]["stood"] >= 2  # of three falls that all stood when this was written
    peer.print_table(result)
