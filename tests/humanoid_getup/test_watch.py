import numpy as np

from drivers import Twin
from humanoid_getup.watch import Watch, count_episodes


def test_a_fault_counts_once_until_it_stayed_away_long_enough():
    flags = np.zeros((40, 2), dtype=bool)
    flags[[3, 4, 5, 8, 30], 0] = True  # 8 follows 5 within the gap, 30 does not
    assert count_episodes(flags, apart=12) == [2, 0]


def test_a_run_without_a_cycle_did_not_stand(op3):
    watched = Watch(Twin(op3).simulation, None).conclude()
    assert not watched.stand.stood
    assert watched.peak_torque == 0.0
    assert watched.self_collisions == 0
