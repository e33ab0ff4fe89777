"""The conditions of a benchmark are those of the robot that is measured."""

import mujoco
import pytest

from humanoid_getup.benchmarks.bench_result import BenchHead
from humanoid_getup.benchmarks.conditions import describe_conditions
from humanoid_getup.simulation.world import World
from robots import Robot, TorqueLimit


def test_conditions_are_those_of_robot_and_world(op3: Robot, world: World):
    about = describe_conditions(world, TorqueLimit(2.0, "current").on(op3))
    assert about.servos == {"XM430-W350": 20}
    assert about.mass_kg == pytest.approx(3.147, abs=0.001)  # of the maker's description
    assert about.stall_torque_nm == pytest.approx(4.1)
    assert (about.joints, about.scene, about.limit_by) == (20, "flat", "current")
    assert about.mujoco == mujoco.__version__


def test_a_result_without_a_table_cannot_be_made():
    with pytest.raises(TypeError, match="abstract method 'table'"):
        BenchHead(name="rise", seed=0, n=1)  # type: ignore[abstract]
