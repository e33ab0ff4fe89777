import numpy as np
import pytest

from humanoid_getup.studio.takes.take import Take

TIME = np.array([2.0, 2.5, 3.0, 3.0, 4.0])


def make_take(**fields: np.ndarray) -> Take:
    return Take(**{"name": "take", "time": TIME, "qpos": np.zeros((5, 7))} | fields)  # pyright: ignore[reportArgumentType]


def test_a_time_shows_the_last_sample_before_it():
    times = (-1, 0, 0.49, 0.5, 1, 9)
    assert [make_take().find(at) for at in times] == [0, 0, 0, 1, 3, 4]


@pytest.mark.parametrize(
    ("fields", "problem"),
    [
        ({"time": np.zeros(0), "qpos": np.zeros((0, 7))}, "time is empty"),
        ({"time": TIME[::-1]}, "not increasing"),
        ({"ghost": np.zeros((4, 7))}, "ghost has 4 rows for 5 times"),
        ({"joint_torque": np.zeros((6, 2))}, "joint_torque has 6 rows"),
    ],
)
def test_samples_without_times_are_refused(fields: dict[str, np.ndarray], problem: str):
    with pytest.raises(ValueError, match=problem):
        make_take(**fields)
