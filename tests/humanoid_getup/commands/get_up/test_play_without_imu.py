"""`getup play --without-imu`, as a person uses it."""

import json
import shutil
from pathlib import Path

import pytest
from run_getup import Run
from spoiling import spoil

from robots import Robot

MOTION = "squat_to_stand"


@pytest.fixture
def bare(op3: Robot, tmp_path: Path) -> str:
    """A folder of an OP3 without an IMU, with one motion."""
    folder = Path(shutil.copytree(op3.folder, tmp_path / "bare"))
    for file in folder.glob("motions/*"):
        if file.stem != MOTION:
            file.unlink()
    spoil(folder, 'imu_site = "imu"\n', "")
    text = (folder / "robot.toml").read_text()
    (folder / "robot.toml").write_text(text.split("[bus.board]")[0])
    return str(folder)


@pytest.mark.parametrize("backend", ["twin", pytest.param("virtual", marks=pytest.mark.slow)])
def test_it_is_played_and_the_exit_code_claims_no_stand(bare: str, backend: str, run: Run):
    arguments = ("play", MOTION, "--robot", bare, "--without-imu", "--backend", backend)
    code, out, error = run(*arguments, "--out", "out", "--json", "-")
    assert code == 1
    report = json.loads(out)
    assert report == json.loads(Path("out/report.json").read_text())
    assert report["reason"] == "played; without an IMU it is unknown whether it stands"
    assert report["stood"] is None
    assert "unknown" in error
    assert sorted(path.name for path in Path("out").iterdir()) == ["flight.mcap", "report.json"]
    code, _, error = run("replay", "out/flight.mcap", "--robot", bare)
    assert (code, error.count("\n")) == (2, 1)


def test_everything_else_refuses_in_one_line(bare: str, run: Run):
    played = f"play {MOTION}"
    for command in ("rise --from supine", played, f"{played} --backend virtual", "hold", "sit"):
        code, out, error = run(*command.split(), "--robot", bare)
        assert (code, out, error.count("\n")) == (2, "", 1)
        assert error.startswith("getup: robot 'op3' has no ")
