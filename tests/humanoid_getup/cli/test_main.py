"""Bad input: one line that names the culprit, exit code 2, nothing written."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from humanoid_getup.cli.main import choose_gl, main
from humanoid_getup.motions.motion import Motion
from robots import Robot

MOTION = "squat_to_stand"
Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def run(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Run:
    """Run `getup` in an empty folder; return exit code, standard output, standard error."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments: str) -> tuple[int, str, str]:
        code = main(arguments)
        return code, *capsys.readouterr()

    return run


def posture_record(robot: Robot) -> dict:
    return json.loads(robot.standing.to_json(robot))


def refuse(run: Run, *arguments: str) -> str:
    """Run what must be refused; return the one line."""
    before = sorted(Path.cwd().rglob("*"))
    code, out, error = run(*arguments)
    assert code == 2
    assert out == ""
    assert sorted(Path.cwd().rglob("*")) == before
    assert error.startswith("getup: ")
    assert error.count("\n") == 1
    return error


RISE = ("rise", "--from", "supine", "--out", "out", "--json", "figures.json")


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ((*RISE, "--robot", "nao"), ["unknown robot 'nao'", "op3"]),
        ((*RISE, "--scene", "moon"), ["unknown scene 'moon'", "allowed flat"]),
        ((*RISE, "--from", "upside"), ["unknown start 'upside'", "supine, prone, left, right"]),
        (("rise",), ["from is missing", "allowed supine, prone, left, right"]),
        ((*RISE, "--backend", "gazebo"), ["unknown backend 'gazebo'", "twin, virtual, dynamixel"]),
        ((*RISE, "--backend", "dynamixel"), ["port is missing", "--port /dev/ttyUSB0"]),
        ((*RISE, "--port", "/dev/x"), ["port is /dev/x", "virtual and dynamixel only"]),
        (
            (*RISE, "--backend", "dynamixel", "--port", "/dev/x"),
            ["from is 'supine'", "a real one lies as it is"],
        ),
        (
            ("rise", "--backend", "virtual", "--port", "a=/dev/x"),
            ["port is a=/dev/x", "allowed for robot 'op3': --port main=PATH"],
        ),
        (
            ("rise", "--backend", "dynamixel", "--port", "/dev/x", "--no-filtering"),
            ["no-filtering", "simulated robot"],
        ),
        ((*RISE, "--release", "drop"), ["release is 'drop'", "allowed limp, hold"]),
        ((*RISE, "--attempts", "0"), ["attempts is 0", "1 or more"]),
        (("bus", "--voltage", "-1"), ["voltage is -1 V", "above 0 V"]),
        (("bus", "--latency", "3"), ["latency is 3 s", "0 s to 0.1 s"]),
        (("bus", "--faults", "none.toml"), ["none.toml"]),
        (("bus", "--link", "no/such/port"), ["no/such/port", "there is no folder"]),
        (("preflight", "moonwalk"), ["unknown motion 'moonwalk'", MOTION]),
        (("replay", "none.mcap"), ["none.mcap"]),
        ((*RISE, "--torque-limit", "0"), ["torque limit is 0 N·m", "above 0 N·m"]),
        ((*RISE, "--torque-limit", "-2.5"), ["torque limit is -2.5 N·m", "above 0 N·m"]),
        ((*RISE, "--torque-limit", "nan"), ["torque limit is nan N·m", "above 0 N·m"]),
        ((*RISE, "--torque-limit", "inf"), ["torque limit is inf N·m", "finite"]),
        ((*RISE, "--seed", "-1"), ["seed is -1", "0 or more"]),
        ((*RISE, "--seed", "-1", "--torque-limit", "0"), ["seed is -1", "torque limit is 0"]),
        (("play", "moonwalk", "--out", "out"), ["unknown motion 'moonwalk'", MOTION, ".npz"]),
        (("play", "moonwalk.npz", "--out", "out"), ["moonwalk.npz", "No such file"]),
        (("play", MOTION, "--from", "upside"), ["unknown start 'upside'", "supine"]),
        (("play", MOTION, "--torque-limit", "0"), ["torque limit is 0 N·m"]),
        (("motions", "list", "--robot", "nao"), ["unknown robot 'nao'", "op3"]),
        (("motions", "show", "moonwalk"), ["unknown motion 'moonwalk'", MOTION]),
        (("motions", "play", "moonwalk"), ["unknown motion 'moonwalk'", MOTION]),
        (("motions", "build", "moonwalk"), ["unknown motion 'moonwalk'", MOTION]),
        (("motions", "build", "--jobs", "0"), ["jobs is 0", "1 or more"]),
        (("motions", "build", "--generations", "-3"), ["generations is -3", "1 or more"]),
        (("bench", "rise", "--n", "0"), ["n is 0", "1 or more"]),
        (("bench", "rise", "--torque-limit", "nan"), ["torque limit is nan N·m"]),
    ],
)
def test_a_value_that_cannot_be_used_is_named(run: Run, arguments: tuple[str, ...], told: list):
    line = refuse(run, *arguments)
    for part in told:
        assert part in line


def lose_a_joint(record: dict) -> None:
    del record["joint_pos"]["l_knee"]


def add_nan(record: dict) -> None:
    record["joint_pos"]["l_knee"] = float("nan")


def stretch_quaternion(record: dict) -> None:
    record["orientation"] = [2.0, 0.0, 0.0, 0.0]


def bend_too_far(record: dict) -> None:
    record["joint_pos"]["l_knee"] = 9.0


def sink(record: dict) -> None:
    record["position"][2] -= 0.1


@pytest.mark.parametrize(
    ("spoil", "told"),
    [
        (lose_a_joint, ["joint 'l_knee' is missing"]),
        (add_nan, ["joint_pos.l_knee is nan", "finite"]),
        (stretch_quaternion, ["length 2.0000", "expected 1"]),
        (bend_too_far, ["joint 'l_knee' is +9.000 rad", "expected [-1.798, +2.478] rad"]),
        (sink, ["100.0 mm into the ground", "allowed 5 mm"]),
    ],
)
@pytest.mark.parametrize("command", [("rise",), ("play", MOTION)])
def test_a_wrong_posture_is_refused(
    run: Run, op3: Robot, command: tuple[str, ...], spoil: Callable[[dict], None], told: list
):
    record = posture_record(op3)
    spoil(record)
    Path("fallen.json").write_text(json.dumps(record))
    line = refuse(run, *command, "--from", "fallen.json", "--out", "out")
    for part in told:
        assert part in line


def test_a_posture_file_that_is_not_json_is_refused(run: Run):
    Path("fallen.json").write_text("{'position':")
    assert "posture file fallen.json: not JSON" in refuse(run, "rise", "--from", "fallen.json")


def test_a_folder_is_no_posture_file(run: Run):
    Path("fallen").mkdir()
    assert "posture file fallen: Is a directory" in refuse(run, "rise", "--from", "fallen")


def test_a_damaged_motion_file_is_refused(run: Run, op3: Robot):
    whole = (op3.folder / "motions" / f"{MOTION}.npz").read_bytes()
    Path("half.npz").write_bytes(whole[: len(whole) // 2])
    line = refuse(run, "play", "half.npz", "--out", "out")
    assert "motion file half.npz" in line
    assert "expected: an .npz" in line


def test_another_robots_motion_is_refused(run: Run, op3: Robot):
    motion = Motion.load(op3.folder / "motions" / f"{MOTION}.npz")
    fields = {name: getattr(motion, name) for name in motion.__dataclass_fields__}
    Motion(**{**fields, "robot": "nao"}).save(Path("other.npz"))
    line = refuse(run, "motions", "show", "other.npz")
    assert "made for 'nao' with 20 joints, allowed 'op3' with 20" in line


def test_a_damaged_motion_in_the_database_is_named(run: Run, op3: Robot):
    robot = Path(shutil.copytree(op3.folder, "mine"))
    (robot / "motions" / "broken.npz").write_bytes(b"PK\x03\x04 and no more")
    line = refuse(run, "rise", "--robot", "mine", "--from", "supine", "--out", "out")
    assert "mine/motions/broken.npz" in line


def test_a_robot_without_motions_cannot_rise(run: Run, op3: Robot):
    ignore = shutil.ignore_patterns("motions")
    shutil.copytree(op3.folder, "mine", ignore=ignore)
    line = refuse(run, "rise", "--robot", "mine", "--from", "supine")
    assert "robot 'op3' has no motions" in line


def test_the_output_folder_is_checked_before_the_work(run: Run):
    Path("file").write_text("in the way")
    Path("taken/report.json").mkdir(parents=True)
    Path("loop").symlink_to("nowhere")
    began = time.perf_counter()
    for out, told in (
        ("file", "file is not a folder"),
        ("file/below/it", "file is not a folder"),
        ("loop", "loop is not a folder"),
        ("taken", "output file taken/report.json: is a folder"),
        ("x" * 300, "File name too long"),
        ("new/" + "x" * 300, "File name too long"),
    ):
        line = refuse(run, "rise", "--from", "supine", "--out", out)
        assert told in line
        assert "allowed" in line
    assert time.perf_counter() - began < 5.0  # a rise would take longer


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs /proc")
def test_an_output_folder_where_nothing_can_be_written_is_refused(run: Run):
    assert "/proc/rise" in refuse(run, "rise", "--from", "supine", "--out", "/proc/rise")
    assert "/proc" in refuse(run, "rise", "--from", "supine", "--json", "/proc/figures.json")
    assert "/proc" in refuse(run, "motions", "show", MOTION, "--out", "/proc/strip.png")


def test_a_json_file_that_is_a_folder_is_refused(run: Run):
    Path("figures").mkdir()
    for command in (["rise", "--from", "supine"], ["robots"], ["motions", "list"]):
        line = refuse(run, *command, "--json", "figures")
        assert "output file figures: is a folder, allowed a file" in line


@pytest.mark.parametrize(
    "arguments",
    [[], ["fly"], ["rise", "--from", "supine", "--torque-limit", "much"], ["motions"]],
)
def test_a_command_line_that_cannot_be_read_leaves_with_2(arguments: list[str]):
    with pytest.raises(SystemExit) as left:
        main(arguments)
    assert left.value.code == 2


@pytest.mark.parametrize("told", [signal.SIGINT, signal.SIGTERM])
def test_a_program_told_to_stop_leaves_with_130_and_the_flight_log_alone(told: int, tmp_path: Path):
    command = [sys.executable, "-m", "humanoid_getup.cli.main", "play", "supine_sit_up_gentle"]
    command += ["--realtime", "--out", str(tmp_path / "out")]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        time.sleep(4.0)  # it plays for eight seconds
        process.send_signal(told)
        _, error = process.communicate(timeout=30.0)
    assert process.returncode == 130
    assert error.splitlines()[-1] == "getup: interrupted"
    assert [path.name for path in tmp_path.rglob("*") if path.is_file()] == ["flight.mcap"]


def test_without_a_display_mujoco_is_told_to_render_by_egl():
    headless: dict[str, str] = {}
    choose_gl(headless)
    assert headless == ({"MUJOCO_GL": "egl"} if sys.platform == "linux" else {})
    for chosen in ({"DISPLAY": ":0"}, {"MUJOCO_GL": "osmesa"}):
        environment = dict(chosen)
        choose_gl(environment)
        assert environment == chosen


def test_a_gl_that_does_not_exist_is_named():
    environment = {**os.environ, "MUJOCO_GL": "crayon"}
    command = [sys.executable, "-m", "humanoid_getup.cli.main", "robots"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "MUJOCO_GL: crayon, allowed egl" in done.stderr
    assert done.stderr.count("\n") == 1


def test_motions_are_listed(run: Run, op3: Robot):
    code, out, _ = run("motions", "list", "--json", "-")
    assert code == 0
    listed = {row["name"]: row for row in json.loads(out)["motions"]}
    stored = sorted(path.stem for path in (op3.folder / "motions").glob("*.npz"))
    assert sorted(listed) == stored
    squat = listed[MOTION]
    motion = Motion.load(op3.folder / "motions" / f"{MOTION}.npz")
    assert (squat["start_class"], squat["mirrored"]) == ("squat", False)
    assert squat["duration_s"] == pytest.approx(motion.duration)
    assert squat["stand_time_s"] == pytest.approx(motion.provenance["stand_time_s"])
    code, out, _ = run("motions", "list")
    assert code == 0
    assert [line.split()[0] for line in out.splitlines()[1:]] == stored


def test_a_motion_is_shown_as_a_film_strip_or_not_at_all(run: Run):
    code, out, error = run("motions", "show", MOTION, "--out", "new/strip.png")
    if code:
        assert error.startswith("no film strip: no GL to render with")
        assert list(Path.cwd().iterdir()) == []
    else:
        assert out == "film strip in new/strip.png\n"
        assert [path.name for path in Path("new").iterdir()] == ["strip.png"]
        assert Path("new/strip.png").read_bytes().startswith(b"\x89PNG")


def test_robots_are_listed(run: Run, op3: Robot):
    code, out, _ = run("robots", "--json", "-")
    assert code == 0
    (row,) = json.loads(out)["robots"]
    assert row["name"] == "op3"
    assert row["dof"] == 20
    assert row["mass_kg"] == pytest.approx(3.147, abs=0.001)  # the sum of the links
    assert row["neck_height_m"] == pytest.approx(op3.standing_neck_height)
    assert row["motions"] == len(list((op3.folder / "motions").glob("*.npz")))
    code, out, _ = run("robots")
    assert code == 0
    assert out.splitlines()[1].split()[:2] == ["op3", "20"]


def test_a_motion_is_built_into_a_users_own_robot(run: Run, op3: Robot):
    robot = Path(shutil.copytree(op3.folder, "mine", ignore=shutil.ignore_patterns("motions")))
    code, out, _ = run(
        "motions", "build", MOTION, "--robot", "mine", "--generations", "1", "--jobs", "1"
    )
    assert code == 0
    assert out == "built 1 of 1 into mine/motions\n"
    assert [path.name for path in (robot / "motions").iterdir()] == [f"{MOTION}.npz"]
    motion = Motion.load(robot / "motions" / f"{MOTION}.npz")
    assert np.isfinite(motion.joint_target).all()
    assert motion.provenance["generations"] == 1
