"""Command lines of version 0.2.0 are read, and answered with what to type now."""

import shlex

import pytest

from humanoid_getup.cli.commands import parse
from humanoid_getup.jobs.errors import BadInputError

TABLE = [
    ("motions play squat_to_stand", "play squat_to_stand"),
    ("motions retarget --robot mine --from op3", "motions retarget --robot mine --source op3"),
    ("motions retarget --robot a --from=human", "motions retarget --robot a --source=human"),
    ("motions show squat_to_stand --out a.png", "motions show squat_to_stand --picture a.png"),
    ("motions preview key --out a.png", "motions preview key --picture a.png"),
    ("robots check op3 --out a.png", "robots check op3 --picture a.png"),
    ("train --out a --from b", "train --out a --parent b"),
    (
        "style extract a.bvh --from 1 --to 2 --out a.toml",
        "style extract a.bvh --begin 1 --end 2 --out a.toml",
    ),
    ("mocap import a.bvh --from 1.5 --to 2", "mocap import a.bvh --begin 1.5 --end 2"),
    ("bench methods --ways plan robust --n 4", "bench methods --ways plan,robust --n 4"),
    ("bench scenes --scenes wall beam", "bench scenes --scenes wall,beam"),
    ("bench disturbed --policies --cases a b", "bench disturbed --policies '' --cases a,b"),
    ("bench disturbed --policies a b", "bench disturbed --policies a,b"),
    ("prior --out a --policies", "prior --out a --policies ''"),
    ("calibrate --port p --joint a b --yes", "calibrate --port p --joint a,b --yes"),
    ("motions import --page 1 2 a.bin", "motions import --page 1,2 a.bin"),
    ("rise --from prone --key a --key b", "rise --from prone --key a,b"),
    ("robots import a.xml --out b --fix c --fix d", "robots import a.xml --out b --fix c,d"),
    (
        "robots import --servo A --servo B=*k a.xml --out b",
        "robots import --servo 'A,B=*k' a.xml --out b",
    ),
    ("doctor --port a=x --port b=y", "doctor --port a=x,b=y"),
    ("sit --backend dynamixel --port a=x b=y", "sit --backend dynamixel --port a=x,b=y"),
    (
        "play a --backend dynamixel --port b --at 0.5 -1 90",
        "play a --backend dynamixel --port b --at 0.5,-1,90",
    ),
    ("style edit sit-up --hold 1 0.5 --out a.toml", "style edit sit-up --hold 1,0.5 --out a.toml"),
]
"""Old spelling, and what is typed now."""


@pytest.mark.parametrize(("old", "new"), TABLE)
def test_an_old_spelling_is_read_and_answered_with_the_new_one(
    old: str, new: str, capsys: pytest.CaptureFixture[str]
):
    read = parse(shlex.split(old))
    assert capsys.readouterr().err == f"getup: an old spelling, now: getup {new}\n"
    assert parse(shlex.split(new)) == read
    assert capsys.readouterr().err == ""


def test_an_option_that_a_command_never_had_is_answered_with_no_new_spelling(
    capsys: pytest.CaptureFixture[str],
):
    with pytest.raises(BadInputError, match="unknown option '--scenes', expected --scene:"):
        parse(["eval", "robust", "--scenes", "flat", "ice"])
    assert "an old spelling" not in capsys.readouterr().err
