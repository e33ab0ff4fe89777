"""`getup rise`: what it says before it plans."""

import json
import shutil
from pathlib import Path

import pytest
from run_getup import Run

from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.main import main
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import BODY
from robots import Robot


@pytest.mark.parametrize("side", ["supine", "prone"])
def test_a_side_without_motion_is_warned_of_at_the_beginning(
    run: Run, op3: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, side: str
):
    mini = tmp_path / "mini"
    shutil.copytree(op3.folder, mini, ignore=shutil.ignore_patterns("policies", "motions"))
    (mini / "motions").mkdir()
    shutil.copy(op3.folder / "motions" / "prone_push_up_fast.npz", mini / "motions")

    def end(*_: object, **__: object) -> None:
        raise BadInputError("that is all")

    monkeypatch.setattr("humanoid_getup.commands.get_up.rise.run_session", end)
    code, _, error = run("rise", "--from", side, "--robot", str(mini))
    warning = (
        f"getup: 'op3' has no motion from {side}; next: getup motions discover --robot {mini}\n"
    )
    assert (code, error) == (2, (warning if side == "supine" else "") + "getup: that is all\n")


BODY_TEXT = "shoulders=1.2"


@pytest.mark.usefixtures("no_film")
def test_a_flight_with_another_body_is_replayed_with_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    out = tmp_path / "wide"
    flown = f"play squat_to_stand --body {BODY_TEXT} --out {out}"
    assert main(flown.split()) == 0
    assert json.loads((out / "report.json").read_text())["body"] == BODY_TEXT
    assert Motion.load(out / "motion.npz").provenance[BODY] == BODY_TEXT
    capsys.readouterr()
    assert main(["replay", str(out / "flight.mcap"), "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["about"]["body"] == BODY_TEXT
