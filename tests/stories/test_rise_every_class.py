import json

import pytest

from humanoid_getup.commands.main import main


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("origin", ["supine", "prone", "left", "right"])
def test_a_fallen_op3_gets_up(origin, seed, tmp_path):
    out = tmp_path / "rise"
    assert main(["rise", "--from", origin, "--seed", str(seed), "--out", str(out)]) == 0
    report = json.loads((out / "report.json").read_text())
    assert report["start_class"] == origin
    assert report["planned"]
    assert report["stood"]
    assert report["hold_s"] >= 3.0
    assert report["stand_time_s"] < 8.0
    assert report["limit_violations"] == 0
    assert report["clips"] == 0
    assert (out / "motion.npz").is_file()


@pytest.mark.slow
@pytest.mark.parametrize("origin", ["supine", "prone", "left"])
def test_a_weak_op3_gets_up_too(origin, tmp_path):
    code = main(["rise", "--from", origin, "--torque-limit", "2.5", "--out", str(tmp_path / "r")])
    assert code == 0
    report = json.loads((tmp_path / "r" / "report.json").read_text())
    assert report["peak_torque_nm"] <= 2.5
