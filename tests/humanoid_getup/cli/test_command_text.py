import shlex
from pathlib import Path

import pytest

from humanoid_getup.cli.commands import parse
from humanoid_getup.jobs.requests.command_text import write_command
from humanoid_getup.jobs.requests.plan import PlanRequest
from humanoid_getup.jobs.requests.rise import RiseRequest, RunRequest
from humanoid_getup.jobs.requests.shared import JobRequest


@pytest.mark.parametrize(
    ("name", "request_"),
    [
        ("rise", RiseRequest(origin="prone")),
        ("rise", RiseRequest(origin="left", planning=False, prefer="torque", torque_limit=2.5)),
        ("rise", RiseRequest(origin="left", out=Path("a folder"), body="arms=1.2", attempts=1)),
        ("plan", PlanRequest(origin="prone", key=("motions:prone_push_up_gentle@1.0",) * 2)),
        ("run", RunRequest(policy="robust", origin="supine", seed=7)),
    ],
)
def test_the_written_command_stands_for_its_request(name: str, request_: JobRequest):
    words = shlex.split(write_command(name, request_))
    assert words[0] == "getup"
    read = parse(words[1:])
    assert read.name == name
    assert vars(request_).items() <= vars(read.options).items()


def test_only_what_differs_from_a_default_is_written():
    assert write_command("rise", RiseRequest(origin="prone")) == "getup rise --from prone"
