"""A command refuses what a person can correct, and shows where we are at fault."""

import pickle

import numpy as np
import pytest

from humanoid_getup.commands.command import command
from humanoid_getup.commands.errors import BadInputError, refusing_own
from humanoid_getup.commands.options import RobotOption
from humanoid_getup.commands.plan.preflight import preflight
from humanoid_getup.progress.callback import ProgressMonitor
from robots import Body


def test_an_own_value_error_is_a_refusal_and_one_of_a_library_a_fault():
    with pytest.raises(BadInputError, match="tail"), refusing_own():
        Body.parse("tail=2")
    with pytest.raises(ValueError, match="broadcast") as fault, refusing_own():
        np.add(np.zeros(2), np.zeros(3))
    assert not isinstance(fault.value, BadInputError)


def test_a_command_takes_its_own_kind_of_request_alone():
    @command("trial")
    def echo(request: RobotOption, _: ProgressMonitor) -> str:
        return request.robot

    assert echo(RobotOption(robot="tiny")) == "tiny"
    with pytest.raises(BadInputError, match="request is 3, expected a RobotOption"):
        echo(3)  # pyright: ignore[reportArgumentType]


def test_another_process_gets_a_command_by_its_name():
    assert pickle.loads(pickle.dumps(preflight)) is preflight
