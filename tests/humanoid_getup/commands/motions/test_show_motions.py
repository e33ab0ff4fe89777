"""`getup motions list` and `show`."""

import json
from pathlib import Path

import pytest
from run_getup import Run

from humanoid_getup.motions.motion import Motion
from robots import Robot

MOTION = "squat_to_stand"


def test_motions_are_listed(run: Run, op3: Robot):
    code, out, _ = run("motions", "list", "--json", "-")
    assert code == 0
    listed = {row["name"]: row for row in json.loads(out)["motions"]}
    stored = sorted(path.stem for path in (op3.folder / "motions").glob("*.npz"))
    assert sorted(listed) == stored
    motion = Motion.load(op3.folder / "motions" / f"{MOTION}.npz")
    assert (listed[MOTION]["start_class"], listed[MOTION]["mirrored"]) == ("squat", False)
    assert listed[MOTION]["duration_s"] == pytest.approx(motion.duration)
    assert listed[MOTION]["stand_time_s"] == pytest.approx(motion.provenance["stand_time_s"])
    code, out, _ = run("motions", "list")
    assert code == 0
    assert [line.split()[0] for line in out.splitlines()[-len(stored) :]] == stored


def test_a_motion_is_shown_as_a_film_strip_or_not_at_all(run: Run):
    code, out, error = run("motions", "show", MOTION, "--picture", "new/strip.png")
    if code:
        assert error.startswith("getup: no film strip: no GL to render with")
        assert list(Path.cwd().iterdir()) == []
    else:
        assert out == "film strip in new/strip.png\n"
        assert [path.name for path in Path("new").iterdir()] == ["strip.png"]
        assert Path("new/strip.png").read_bytes().startswith(b"\x89PNG")
