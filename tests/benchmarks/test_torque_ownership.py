"""The benchmark of torque in each phase: how a robot ends, and what is said of its torque."""

import numpy as np
from benchmark_scripts import load_script


def test_a_servo_that_falls_silent_in_a_rise_is_named_while_the_others_go_limp():
    script = load_script("torque_ownership")
    world = script.make_world("X")
    trial = script.try_event(world, "rise", "silent servo", 40, np.random.default_rng(0))
    assert (trial.end, trial.unsaid, trial.beyond_limits) == ("limp but for 1", 0, 0)
    assert trial.safe_s < 0.15
