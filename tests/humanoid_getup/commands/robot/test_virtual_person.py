"""What is typed at `getup bus`, a person at the virtual robot does."""

import os

import numpy as np
import pytest

from drivers.twin.simulation import Simulation
from drivers.virtual_bus.served_robot import serve_robot
from drivers.virtual_bus.serving.server import TimeMode
from humanoid_getup.commands.prompt import TypedLines
from humanoid_getup.commands.robot.virtual_person import VirtualPerson
from humanoid_getup.simulation.world import World


@pytest.fixture
def met(tiny):
    simulation = Simulation(tiny)
    with serve_robot(simulation, time_mode=TimeMode.LOCK_STEP) as served:
        yield VirtualPerson(served, World(tiny), np.random.default_rng(0)), simulation


def test_a_held_robot_hangs_above_the_ground_and_is_turned(met, tiny):
    person, simulation = met
    joint = tiny.joint_names[0]
    person.do("hold zero")
    assert simulation.data.ncon == 0
    person.do(f"turn {joint}:10")
    person.do(f"  turn {joint}:-4 ")
    assert simulation.joint_pos[0] == pytest.approx(np.radians(6.0))
    person.do("hold standing")
    np.testing.assert_allclose(simulation.joint_pos, tiny.standing.joint_pos)
    assert simulation.data.qpos[2] == pytest.approx(tiny.standing.position[2])
    person.do("hang standing")
    np.testing.assert_allclose(simulation.joint_pos, tiny.standing.joint_pos)
    assert simulation.data.qpos[2] > tiny.standing.position[2] + 0.04


REFUSED = {
    "jump": "'jump' is not understood, expected hold POSTURE, hang POSTURE, turn JOINT:DEG",
    "hold": "'hold' is not understood",
    "turn knee_9:4": "turn knee_9:4: unknown joint 'knee_9', expected JOINT:DEG",
    "turn l_hip:far": "expected JOINT:DEG, an angle in degrees",
    "turn l_hip:4": "the robot is not held",
    "lay upright": "unknown start 'upright', expected supine",
}


def test_what_cannot_be_done_is_refused_in_one_line(met):
    person, simulation = met
    before = simulation.data.qpos.copy()
    for sentence, problem in REFUSED.items():
        with pytest.raises(ValueError, match=problem):
            person.do(sentence)
    np.testing.assert_array_equal(simulation.data.qpos, before)


def test_lines_are_taken_whole_and_the_end_of_the_input_is_no_line():
    reading, writing = os.pipe()
    lines = TypedLines(reading)
    os.write(writing, b"hold ze")
    assert lines.wait(0.01) == []
    os.write(writing, b"ro\n\nlet go\n")
    assert lines.wait(5.0) == ["hold zero", "let go"]
    os.close(writing)
    assert lines.wait(5.0) == []
    assert lines.wait(0.0) == []
    os.close(reading)
