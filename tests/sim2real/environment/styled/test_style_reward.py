"""What counts at the end of a curve counts by the curve, not by how high the robot is."""

import numpy as np
import pytest

from sim2real.environment.styled.style_reward import POSTURE_WEIGHT, SPEED_WEIGHT, reward_style


@pytest.mark.parametrize(("wanted", "measured", "counts"), [(1.0, 0.3, True), (0.3, 1.0, False)])
def test_the_end_of_a_curve_is_where_it_wants_the_robot_to_stand(
    wanted: float, measured: float, counts: bool
):
    reward = reward_style(
        features=np.array([[measured, 0.0, 0.0]]),
        wanted=np.array([[wanted, 0.0, 0.0]]),
        speed=np.full((1, 4), 10.0),  # a norm of 20 rad/s
        from_stance=np.full((1, 2), 2.0),
        offsets=np.zeros((1, 2)),
    )
    stillness, posture = np.exp(-20.0 * SPEED_WEIGHT), np.exp(-4.0 * POSTURE_WEIGHT)
    expected = (stillness, posture) if counts else (1.0, 1.0)
    assert (reward.stillness[0], reward.posture[0]) == pytest.approx(expected, abs=1e-4)
