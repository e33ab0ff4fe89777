"""The maker's keyframes as a peer; skipped without them."""

import importlib.util
import sys

import numpy as np
import pytest
from paths import REPOSITORY, SHARED

from humanoid_getup.simulation.falls import sample_falls
from humanoid_getup.strategies.plan import RiseStatus
from robots import TorqueLimit, quaternion

PEERS = SHARED / "peers"
pytestmark = pytest.mark.skipif(not PEERS.exists(), reason="needs the maker's pages in ../shared")


@pytest.fixture(scope="module")
def peer():
    path = REPOSITORY / "benchmarks" / "peer_keyframes.py"
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("number", [122, 123])
def test_a_page_passes_its_postures_on_time_and_rests_in_its_pauses(peer, op3, number):
    page = peer.Page.load(PEERS, number, op3)
    np.testing.assert_allclose(page.sample(page.time), page.joint_pos, atol=1e-12)
    step = 1e-6
    for time in (page.time[0], page.time[-1]):  # begins and ends at rest
        speed = (page.sample(time + step) - page.sample(time)) / step
        assert np.abs(speed).max() < 1e-3
    pauses = np.flatnonzero(np.all(np.diff(page.joint_pos, axis=0) == 0.0, axis=1))
    assert len(pauses) > 0
    for k in pauses:
        during = page.sample(np.linspace(page.time[k], page.time[k + 1], 5))
        np.testing.assert_allclose(during, np.broadcast_to(page.joint_pos[k], during.shape))


def test_a_joint_that_keeps_its_direction_does_not_stop_at_a_step(peer):
    page = peer.Page(
        name="ramp",
        time=np.array([0.0, 1.0, 2.0]),
        joint_pos=np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 0.0]]),
    )
    speed = (page.sample(np.array([1.001])) - page.sample(np.array([0.999])))[0] / 0.002
    assert speed[0] == pytest.approx(1.0, abs=0.01)  # goes on
    assert speed[1] == pytest.approx(0.0, abs=0.01)  # reverses


def test_the_page_is_chosen_by_where_the_chest_faces(peer, op3, world):
    strategy = peer.KeyframeRise(PEERS, op3)
    rng = np.random.default_rng(5)
    falls = sample_falls(world, {"supine": 1, "prone": 1, "lateral": 2}, rng)
    for fall in falls:
        chest_down = quaternion.rotate(fall.posture.orientation, np.array([1.0, 0.0, 0.0]))[2] < 0.0
        plan = strategy.plan(fall.posture, rng)
        assert plan.status is RiseStatus.STORED
        assert plan.motion.start_class == ("prone" if chest_down else "supine")


def test_all_get_up_from_the_same_falls_under_the_same_limit(peer, world):
    records = []
    limits = {"none": TorqueLimit(), "3 N·m by PWM": TorqueLimit(3.0, "pwm")}
    result = peer.compare(world, PEERS, seed=4, each=1, limits=limits, report=records.append)
    assert list(result["limits"]) == list(limits)
    starts = [record["start_class"] for record in records]
    assert len(starts) == 18
    assert starts[:3] * 6 == starts
    for ways in result["limits"].values():
        assert list(ways) == [peer.PLANNED, peer.ROBUST, peer.PEER]
        for way, case in ways.items():
            assert case["n"] == 3
            assert case["stood"] == sum(case["stood_by_class"].values())
            assert case["stood"] + len(case["failures"]) == 3
            assert case["stand_time_s"]["median"] is None or case["stand_time_s"]["median"] > 0.5
            if way == peer.PEER:
                assert case["not_played"] == 0
    peaks = {
        name: ways[peer.PEER]["peak_torque_nm"]["median"] for name, ways in result["limits"].items()
    }
    assert all(peak is not None and peak > 0.0 for peak in peaks.values())
    peer.print_table(result)
