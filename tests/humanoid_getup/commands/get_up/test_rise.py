"""`getup rise`: what it says before it plans."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from run_getup import Run

from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.main import main
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import BODY
from humanoid_getup.strategies.plan import Plan
from humanoid_getup.strategies.planned_rise import PlannedRise
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


@pytest.mark.usefixtures("no_film")
def test_an_object_in_a_hand_is_of_plan_twin_and_replay(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    planned_with = list[float]()
    plan = PlannedRise.plan

    def note(self: PlannedRise, *args: Any, **kwargs: Any) -> Plan:
        planned_with.append(self.world.model.body("load_l_hand").mass.item())
        return plan(self, *args, **kwargs)

    monkeypatch.setattr(PlannedRise, "plan", note)
    flown = f"rise --from prone --seed 3 --load l_hand:0.2 --out {tmp_path}"
    assert main(flown.split()) == 0
    assert planned_with == [0.2]
    assert json.loads((tmp_path / "report.json").read_text())["load"] == "l_hand:0.2"
    capsys.readouterr()
    assert main(["replay", str(tmp_path / "flight.mcap"), "--json", "-"]) == 0
    replayed = json.loads(capsys.readouterr().out)
    assert replayed["about"]["load"] == "l_hand:0.2"
    assert replayed["divergence_s"] is None


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
