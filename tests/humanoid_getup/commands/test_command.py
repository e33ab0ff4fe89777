"""A command refuses what a person can correct, and shows where we are at fault."""

import inspect
import pickle
from pathlib import Path

import numpy as np
import pytest
from nonempty import nonempty
from run_getup import Run

from humanoid_getup.commands.command import command
from humanoid_getup.commands.errors import BadInputError, refusing_own
from humanoid_getup.commands.get_up.rise import RiseRequest, rise
from humanoid_getup.commands.options import RobotOption
from humanoid_getup.commands.plan.preflight import PreflightRequest, preflight
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


def test_callbacks_are_functions_and_a_call_shows_its_own_arguments():
    with pytest.raises(BadInputError, match="cancel is True, expected a function"):
        preflight(PreflightRequest(motion="none"), cancel=True)  # pyright: ignore[reportArgumentType]
    with pytest.raises(BadInputError, match="operator is 5, expected an Operator"):
        rise(RiseRequest(origin="supine"), operator=5)
    assert [*inspect.signature(preflight).parameters][:3] == ["request", "report", "cancel"]


def test_outputs_that_cannot_be_beside_each_other_are_refused_before_the_work(run: Run):
    for words, problem in nonempty(
        {
            "rise --from prone --out x --json x": "--json is the folder of --out",
            "rise --from prone --out x --json x/report.json/y": "--json is below the file of --out",
            "motions show prone_push_up --picture x.csv": "expected a name ending in .png",
        }.items()
    ):
        code, _, error = run(*words.split())
        assert (code, problem in error) == (2, True), error
        assert [*Path().iterdir()] == []
