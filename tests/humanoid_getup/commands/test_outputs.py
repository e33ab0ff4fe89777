"""Files appear complete and together, or not at all; devices and links stay what they are."""

import errno
import io
import resource
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from paths import REPOSITORY
from rich.console import Console
from rich.text import Text
from run_getup import Run

from humanoid_getup.commands import console as console_module
from humanoid_getup.commands.command import write_json
from humanoid_getup.commands.console import format_figure, make_bars, showing
from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.files import find_file_problems, find_folder_problems, staging
from humanoid_getup.commands.get_up.play import PlayRequest
from humanoid_getup.commands.get_up.results import draw_run
from humanoid_getup.commands.get_up.run import RunRequest
from humanoid_getup.commands.learn.train import ExportRequest
from humanoid_getup.commands.options import JsonOption, with_json
from humanoid_getup.experiments.judging.summary import Quantiles
from humanoid_getup.progress.callback import Progress, ProgressMonitor
from humanoid_getup.reporting import film_strip, plots
from robots import Robot
from robots.storage.files import atomic_path

NAMES = ("report.json", "strip.png")


def test_files_appear_together_earlier_ones_go_and_the_users_own_stay(tmp_path: Path):
    folder = tmp_path / "new" / "out"
    with staging(folder, NAMES) as scratch:
        for name in NAMES:
            (scratch / name).write_text(name)
        assert not folder.exists()
    assert sorted(path.name for path in folder.iterdir()) == sorted(NAMES)
    assert list(tmp_path.iterdir()) == [tmp_path / "new"]
    (folder / "notes.txt").write_text("old")
    with staging(folder, NAMES) as scratch:
        (scratch / "report.json").write_text("new")
    left = {path.name: path.read_text() for path in folder.iterdir()}
    assert left == {"report.json": "new", "notes.txt": "old"}


def test_what_gets_in_the_way_during_the_work_is_reported(tmp_path: Path):
    folder = tmp_path / "out"
    message = pytest.raises(BadInputError, match=r"output folder .*out: File exists")
    with message, staging(folder, NAMES) as scratch:
        (scratch / "report.json").write_text("new")
        folder.write_text("meanwhile")
    assert folder.read_text() == "meanwhile"


def test_pictures_for_which_there_is_no_room_do_not_take_the_report_with_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def fail(*_: object, **__: object) -> None:
        with atomic_path(tmp_path / "strip.png"):
            raise OSError(errno.EFBIG, "File too large")

    monkeypatch.setattr(plots, "save_torque", lambda *_, **__: None)
    monkeypatch.setattr(film_strip, "save_run", fail)
    world: Any = SimpleNamespace(robot=SimpleNamespace(control_period=0.008), model=None)
    outcome: Any = SimpleNamespace(qpos=np.zeros((3, 7)))
    reason = draw_run(outcome, world, PlayRequest(motion="any"), tmp_path, "title")
    assert reason == "strip.png: File too large"


def test_a_policy_of_a_robot_is_no_output_but_of_what_makes_it(op3: Robot):
    file = op3.folder / "policies" / "robust.onnx"
    for robot in ("", "op3"):
        asked = {"policy": "robust", "robot": robot, "origin": "supine", "json": str(file)}
        (problem,) = with_json(RunRequest)(**asked).find_problems()
        assert problem.startswith("--json: ")
        assert problem.endswith("robust.onnx is a file of the robot, expected another file")
        export = ExportRequest(folder=Path("any"), robot=robot, out=file)
        assert export.find_problems() == []
        assert len(replace(export, out=op3.folder / "robot.toml").find_problems()) == 1


def test_a_full_folder_is_refused_beforehand(tmp_path: Path):
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, hard))
    try:
        problems = find_folder_problems(tmp_path, NAMES), find_file_problems(tmp_path / "a.json")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    expected = [f"output folder {tmp_path}: File too large, expected a folder that can be written"]
    assert problems == (expected, expected)
    assert list(tmp_path.iterdir()) == []


def test_a_link_is_followed_and_stays(tmp_path: Path):
    (tmp_path / "elsewhere").mkdir()
    link = tmp_path / "figures.json"
    link.symlink_to(tmp_path / "elsewhere" / "real.json")
    assert find_file_problems(link) == []
    write_json({}, JsonOption(json=str(link)))
    assert link.is_symlink()
    assert (tmp_path / "elsewhere" / "real.json").read_text() == "{}\n"


def test_figures_intervals_medians_and_counts_are_written_for_people():
    assert format_figure(Quantiles(median=0.5, p95=1.25)) == "0.50 (p95 1.25)"
    assert format_figure({"done": 18, "fault": 2}) == "18 done, 2 fault"
    assert format_figure([0.94, 1.0]) == "0.94 to 1.00"
    assert format_figure([3e-17, 0.0234, 0.1]) == "0.00 to 0.023 to 0.10"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_files_of_a_command_whose_json_cannot_be_written_do_not_appear(run: Run):
    wanted = ("--out", "out", "--json", "/dev/full")
    code, _, error = run("plan", "--from", "supine", "--max-checks", "1", *wanted)
    assert code == 2
    assert error == "getup: output file /dev/full: No space left on device\n"
    assert list(Path().iterdir()) == []


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_device_is_refused_before_the_work(run: Run, monkeypatch):
    monkeypatch.setattr(ProgressMonitor, "show", lambda _, each: pytest.fail(f"{each} begins"))
    for words in (
        f"robots import {REPOSITORY}/robots/op3/model.xml --out out",
        "play squat_to_stand --out out",
        f"log export {REPOSITORY}/README.md --rosbag2 out",
        "bench all --out out",
    ):
        code, _, error = run(*words.split(), "--json", "/dev/full")
        assert (code, error) == (2, "getup: output file /dev/full: No space left on device\n")


def test_progress_that_goes_to_no_terminal_is_a_line_from_time_to_time(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    with showing() as show:
        show(Progress(phase="search", done=100.0, total=60_000.0, note="supine: 26%"))
        assert capsys.readouterr().err == ""
        monkeypatch.setattr(console_module, "LINE_EVERY", 0.0)
        show(Progress(phase="search", done=200.0, total=60_000.0, note="supine: [31%]"))
        show(Progress(phase="squats"))
        show(Progress(message="a motion was found"))
    said = capsys.readouterr()
    assert said.err.splitlines() == ["search 200 of 60000, supine: [31%]", "squats"]
    assert said.out == "a motion was found\n"


def test_a_progress_bar_is_one_line_of_the_terminal():
    note = "cost 12.34, 100% stood, of all its generations so far"
    for width in (60, 80, 200):
        console = Console(file=io.StringIO(), width=width, force_terminal=True, color_system=None)
        with make_bars(console) as bars:
            task = bars.add_task("lateral_asymmetric_squat", total=20, note=note)
            bars.update(task, completed=12)
        last = Text.from_ansi(console.file.getvalue()).plain.splitlines()[-1]
        assert len(last) <= width
        assert last.startswith("lateral_asymmetric_squat ")
        assert " 12/20 " in last and "0:00:0" in last
        assert (note in last) == (width == 200)
        assert ("cost 12" in last) == (width > 60)
