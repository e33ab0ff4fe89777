"""What becomes of torque when LeRobot's process is suspended, told to end, or interrupted."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from waiting import wait_until

from drivers.twin.simulation import Simulation
from drivers.virtual_bus.served_robot import RealTimeRobot
from robots import load_robot

TINY = Path(__file__).parents[3] / "tests" / "robots" / "tiny"
PROGRAM = """
import sys
from pathlib import Path
from lerobot_robot_getup import GetupRobot, GetupRobotConfig
tiny, port, folder = sys.argv[1:]
robot = GetupRobot(GetupRobotConfig(
    model=tiny, backend="dynamixel", port=port, rise="none", calibration_dir=Path(folder)
))
robot.connect()
key = next(iter(robot.action_features))
try:
    while True:
        robot.send_action({key: 3.0})
        print(robot.get_observation()[key], flush=True)
finally:
    robot.disconnect()
"""


@pytest.fixture
def served() -> Iterator[RealTimeRobot]:
    """Virtual servos, which go on while the program stands still."""
    tiny = load_robot(TINY)
    with RealTimeRobot(Simulation(tiny), powered=True) as served:
        served.place(tiny.standing)
        yield served


@pytest.fixture
def program(served: RealTimeRobot, tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    arguments = [str(TINY), served.paths["main"], str(tmp_path)]
    program = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    assert program.stdout is not None
    if not program.stdout.readline():
        pytest.fail(program.communicate()[1])
    yield program
    program.kill()
    program.communicate()


def has_torque(served: RealTimeRobot) -> list[bool]:
    return [motor.motor_command().torque_on for motor in served.physics.motors]


def test_after_a_suspension_the_robot_is_held_where_it_is_and_obeys_on(program, served):
    wait_until(lambda: all(has_torque(served)))
    program.send_signal(signal.SIGSTOP)
    time.sleep(0.6)
    program.send_signal(signal.SIGCONT)
    assert program.stdout is not None
    angles = [float(program.stdout.readline()) for _ in range(100)]
    assert program.poll() is None
    assert angles[-1] == pytest.approx(3.0, abs=1.0)
    assert all(has_torque(served))


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGTSTP])
def test_a_signal_ends_the_program_with_torque_off(number, program, served):
    wait_until(lambda: all(has_torque(served)))
    program.send_signal(number)
    _, errors = program.communicate(timeout=60.0)
    assert program.returncode == 128 + number, errors
    assert not any(has_torque(served))


def test_a_second_interrupt_does_not_cut_off_the_release(program, served):
    wait_until(lambda: all(has_torque(served)))
    for _ in range(5):
        program.send_signal(signal.SIGINT)
        time.sleep(0.002)
    program.communicate(timeout=60.0)
    assert not any(has_torque(served))
