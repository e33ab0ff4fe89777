"""A command line that is printed is the one that asks for the same."""

import shlex
from pathlib import Path

import pytest
from run_getup import Run

from humanoid_getup.commands.command_line import parse
from humanoid_getup.commands.options import write_command

LINES = [
    "getup motions build lateral_side_sit --robot mine --generations 40 --resume",
    "getup motions retarget --robot mine --no-improve --source human",
    "getup bench all --robot 'my robot' --quick --out out/x",
    "getup rise --from prone --scene wall --key a.json,motions:b@1",
    "getup calibrate --port a=x,b=y --joint l_knee",
    "getup replay 'out/my flight.mcap' --voltage 11.1 --threshold 0.1 --out out/replay",
]


def test_a_written_command_reads_as_the_request_that_it_was_written_from():
    for line in LINES:
        invocation = parse(shlex.split(line)[1:])
        written = write_command(invocation.name, invocation.options)
        assert parse(shlex.split(written)[1:]).options == invocation.options
        assert sorted(shlex.split(written)) == sorted(shlex.split(line))


@pytest.mark.parametrize("is_kept", [True, False])
def test_an_interrupted_build_prints_the_command_that_continues_it_if_anything_was_kept(
    run: Run, copied_op3: Path, monkeypatch: pytest.MonkeyPatch, is_kept: bool
):
    unfinished = copied_op3 / "unfinished"
    unfinished.mkdir()
    if is_kept:
        (unfinished / "squat_to_stand.jsonl").touch()

    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("humanoid_getup.commands.motions.build_motions.starting", interrupt)
    wanted = ("squat_to_stand", "--robot", str(copied_op3), "--seed", "3")
    code, _, error = run("motions", "build", *wanted)
    assert code == 130
    again = f"getup motions build squat_to_stand --robot {copied_op3} --seed 3 --resume continues"
    hint = f": {again}" if is_kept else ""
    assert error.splitlines()[-1] == f"getup: interrupted{hint}"
    assert unfinished.exists() == is_kept
