"""LeRobot's own programs, as the documentation starts them, on the twin and the virtual bus."""

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pyarrow.parquet

REPOSITORY = Path(__file__).parents[3]
PAGE = REPOSITORY / "docs/how-to/use_in_lerobot.md"
LONGEST = 400.0  # s; each program imports LeRobot for 10 to 30 s


def list_lines() -> dict[str, str]:
    text = "\n".join(re.findall(r"^```\n(.*?)^```$", PAGE.read_text("utf-8"), re.DOTALL | re.M))
    lines = text.replace("\\\n", " ").splitlines()
    return {line.split()[0]: line for line in lines if line.strip()}


def run(line: str, folder: Path) -> str:
    program, *arguments = shlex.split(line)
    environment = os.environ | {"HF_LEROBOT_HOME": str(folder / "home"), "HF_HUB_OFFLINE": "1"}
    done = subprocess.run(
        [Path(sys.executable).parent / program, *arguments],
        cwd=folder,
        env=environment,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=LONGEST,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout + done.stderr


LINES = list_lines()


def test_the_robot_is_teleoperated(tmp_path: Path):
    assert "Teleop loop time" in run(LINES["lerobot-teleoperate"], tmp_path)


def test_episodes_are_recorded_and_replayed(tmp_path: Path):
    run(LINES["lerobot-record"], tmp_path)
    info = json.loads((tmp_path / "out/swing/meta/info.json").read_text())
    assert info["total_episodes"] == 2
    assert info["robot_type"] == "getup"
    names = info["features"]["observation.state"]["names"]
    assert names[-1] == "getup.rising"
    (file,) = (tmp_path / "out/swing/data").rglob("*.parquet")
    states = pyarrow.parquet.read_table(file)["observation.state"].to_pylist()
    arm = [state[names.index("l_sho_pitch.pos")] for state in states]
    assert max(arm) - min(arm) > 15.0, "the arm swung"
    assert {state[-1] for state in states} == {0.0}
    assert "Replaying episode" in run(LINES["lerobot-replay"], tmp_path)


def test_the_calibration_is_written(tmp_path: Path):
    run(LINES["lerobot-calibrate"], tmp_path)
    (written,) = (tmp_path / "home").rglob("op3.json")
    assert json.loads(written.read_text())["head_pan"]["id"] == 19
