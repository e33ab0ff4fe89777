"""Whether servos lift a robot out of a squat, and which one is too weak."""

from humanoid_getup.posture_chains.lifting import check_lifting, find_least_share
from humanoid_getup.posture_chains.moves import RandomMoves
from humanoid_getup.simulation.world import World
from robots import FULL_TORQUE, TorqueLimit


def test_the_least_torque_with_which_it_rises_is_near_that_of_the_strained_joint(world, few_moves):
    found = check_lifting(world, few_moves, 1.0, TorqueLimit(0.6))
    assert found.joint.endswith("knee")
    assert found.at_limit > 0.5
    least = found.factor * found.torque
    assert check_lifting(world, few_moves, 1.0, TorqueLimit(least)) is None
    assert f"limit of 0.6 N·m for {found.at_limit:.0%} of the time" in found.describe()


def test_a_limit_far_below_what_lifts_the_robot_is_named(world: World, few_moves: RandomMoves):
    found = check_lifting(world, few_moves, 1.0, TorqueLimit(0.05))
    assert found.factor * found.torque > 1.0
    assert found.at_limit > 0.5


def test_a_robot_is_judged_with_no_less_torque_than_lifts_it_out_of_most_squats(world, few_moves):
    """OP3 rises with 61 % of its torque; with a sixth of it, from its highest squats alone."""
    assert find_least_share(world, few_moves, 1.0, FULL_TORQUE, (0.15, 0.61)) == 0.61
    assert find_least_share(world, few_moves, 1.0, TorqueLimit(0.05), (0.9,)) == 1.0
