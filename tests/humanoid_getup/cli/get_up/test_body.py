"""`--body`: what a run writes names the body, and what reads it finds the same one."""

import json
from pathlib import Path

import pytest

from humanoid_getup.cli.main import main
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.retargeting import BODY

BODY_TEXT = "shoulders=1.2"


@pytest.mark.usefixtures("no_film")
def test_a_flight_with_another_body_is_replayed_with_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    out = tmp_path / "wide"
    flown = f"play prone_push_up_gentle --body {BODY_TEXT} --out {out}"
    assert main(flown.split()) == 0
    assert json.loads((out / "report.json").read_text())["body"] == BODY_TEXT
    assert Motion.load(out / "motion.npz").provenance[BODY] == BODY_TEXT
    capsys.readouterr()
    assert main(["replay", str(out / "flight.mcap"), "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["about"]["body"] == BODY_TEXT
