"""Stored motions, joined by the script."""

import numpy as np
import pytest
from join_rises import Joiner, JoinOptions

from humanoid_getup.motions.motion_database import find_motion


def test_a_joined_rise_is_the_first_motion_slower_and_then_the_second(op3):
    options = JoinOptions(
        first="prone_push_up_gentle",
        then=("prone_push_up_gentle",),
        name="joined",
        robot="op3",
        cuts=(0.5,),
        tempos=(0.5,),
        entries=(0.5,),
    )
    motion = find_motion(op3, "prone_push_up_gentle")
    joined = [target for _, target in Joiner(options).combine()]
    slow = round(1.0 / op3.control_period)  # the first half second, half as fast
    for target in joined:
        duration = (len(target) - 1) * op3.control_period
        assert duration == pytest.approx(motion.duration + 0.5, abs=0.02)
        reached = motion.sample(motion.time[0] + 0.5)
        np.testing.assert_allclose(target[slow], reached, atol=0.02)
    np.testing.assert_allclose(joined[0][-1], motion.joint_target[-1], atol=1e-9)
