"""`getup motions import` and `preview`: from another program's file to keys that are played."""

from pathlib import Path

import pytest
from paths import SHARED
from run_getup import Run

from humanoid_getup.motions.keyframes_file import KEYFRAMES, load_keyframes
from robots import Robot, load_robot

ACTIONS = SHARED / "peers" / "op3_motion_4095.bin"


@pytest.mark.skipif(not ACTIONS.exists(), reason="needs the maker's action file")
def test_the_makers_pages_become_keyframes_that_rise(run: Run, copied_op3: Path):
    keyframes = copied_op3 / KEYFRAMES
    before = keyframes.read_text("utf-8")
    wanted = ("motions", "import", str(ACTIONS), "--page", "122,123", "--robot", str(copied_op3))
    code, _, error = run(*wanted)
    assert code == 2
    assert "joint 'l_hip_pitch' of key number 2 is -110.742 deg" in error
    assert keyframes.read_text("utf-8") == before
    code, out, _ = run(*wanted, "--clip")
    assert code == 0
    assert out.count("the nearest is taken") == 10
    assert out.count("undisturbed at full torque: stood after") == 2
    *_, front, back = load_keyframes(keyframes, load_robot(copied_op3))
    assert (front.name, front.start_class) == ("f_get_up_122", "prone")
    assert (back.name, back.start_class) == ("b_get_up_123", "supine")
    code, _, error = run(*wanted, "--clip")
    assert code == 2
    assert "motion 'f_get_up_122', 'b_get_up_123' is there already" in error


def test_keys_may_go_to_a_file_of_their_own_and_be_previewed(run: Run, tmp_path: Path, op3: Robot):
    (tmp_path / "kick.csv").write_text("time,l_knee_deg,r_knee_deg\n0,0,0\n0.3,60,-60\n")
    code, out, _ = run("motions", "import", "kick.csv", "--start", "supine", "--out", "mine.toml")
    assert code == 0
    assert "kick: 3 keys" in out
    assert "from supine (given)" in out
    (read,) = load_keyframes(tmp_path / "mine.toml", op3)
    assert (read.name, read.start_class) == ("kick", "supine")
    preview = ("motions", "preview", "kick", "--keyframes", "mine.toml", "--picture", "strip.png")
    code, out, _ = run(*preview)
    assert code == 1  # a robot on its back does not rise by bending its knees
    message = " ".join(out.split())
    assert "kick, as it is: does not end in a held stand: its neck came to" in message
    assert "on the ground besides the feet since" in message
    assert "body_link" in message
    drawn = tmp_path / "strip.png"
    assert "no film strip" in out or drawn.read_bytes().startswith(b"\x89PNG")
