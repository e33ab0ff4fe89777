"""The benchmark over bodies: one page from a folder, and nothing from a folder that is wrong."""

import json
import os
import pickle
import shutil
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from rise_figures_of import drop_wall_times
from small_repository import SMALL, Repository
from tiny_policies import save_policy

from drivers import Ending
from humanoid_getup.benchmarks.bodies.body_bench import BodyBench
from humanoid_getup.benchmarks.bodies.body_rise import BodyRise, BodyRises
from humanoid_getup.jobs.errors import BadInputError
from humanoid_getup.jobs.measure_bodies import measure_bodies
from humanoid_getup.jobs.pieces.rises_of_bodies import spread_bodies
from humanoid_getup.jobs.requests.bench import BenchBodies
from robots import load_robot
from robots.storage.encoding import as_kept

NO_PLAN = "no path to any connecting posture: the robot has no motions"
CASES = ("small: plan, their starts", "small: plan, falls")


def measure(repository: Repository, out: Path, report=None, **more) -> BodyBench:
    options = {"robots": repository.robots, "n": 1, "starts": 2} | more
    request = BenchBodies(folder=repository.folder, out=out, **options)
    return measure_bodies(request, report, published=(SMALL,))


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("out")


@pytest.fixture(scope="module")
def result(repository, out) -> BodyBench:
    return measure(repository, out)


def test_a_body_without_motions_is_counted_with_honest_zeros(result):
    assert tuple(result.cases) == CASES
    for name, n in zip(CASES, (2, 4), strict=True):
        case = result.cases[name]
        assert (case.n, case.stood, case.head_in_time, case.head_at_end) == (n, 0, 0, 0)
        assert sum(one.n for one in case.classes.values()) == n
        assert case.head_at_end_interval_95[0] == 0.0
    sides = ["supine", "prone", "left", "right"]
    assert list(result.cases[CASES[1]].classes) == sides
    assert result.cases[CASES[1]].failures == [
        f"{number}, {side}: {NO_PLAN}" for number, side in enumerate(sides, 1)
    ]
    assert result.notes[0].startswith("Without motions, and so without a plan that stands: small.")
    assert "getup motions discover" in result.notes[0]
    assert result.notes[1] == "Without a policy, and so with nothing learned: small."


def test_the_page_has_their_figures_apart_from_ours(result, out, repository):
    page = (out / "bodies.md").read_text()
    ours, theirs = page.split("## What their makers report")
    assert "| small | plan | 0 of 2 (0% to 66%) | 0 of 2 (0% to 66%) | 0 of 2 (0% to 66%) |" in ours
    assert "specialists" not in ours
    assert f"| small | plan | 2, prone: {NO_PLAN} |" in ours
    assert "| small | 0.50 (0.25 to 0.75) | 0.10 (0.10 to 0.10) |" in theirs
    assert "commit 2d64e11" in theirs
    assert f"--robots {repository.robots} --n 1 --starts 2 --seed 0 --search-budget 600" in theirs
    assert json.loads((out / "bodies.json").read_text()) == as_kept(result)


def test_a_finished_benchmark_is_resumed_without_a_rise(result, out, repository):
    said = []
    again = measure(repository, out, lambda progress: said.append(progress.message), resume=True)
    assert as_kept(again) == as_kept(result)
    assert "2 of 2 parts are finished" in said


def test_more_starts_continue_a_finished_benchmark(repository, tmp_path):
    own = Repository(tmp_path / "theirs", repository.robots, repository.model)
    shutil.copytree(repository.folder, own.folder)
    own.pickle_starts(13, seed=1)
    said = []
    fewer = measure(own, tmp_path / "out", starts=12)
    more = measure(own, tmp_path / "out", said.append, starts=13, resume=True)
    assert (fewer.cases[CASES[0]].n, more.cases[CASES[0]].n) == (12, 13)
    assert "2 of 3 parts are finished" in [progress.message for progress in said]
    again = measure(own, tmp_path / "again", starts=13)
    assert as_kept(again.cases) == as_kept(more.cases)


def test_starts_are_converted_once_and_again_if_their_file_changes(result, out, repository):
    assert result.n_starts == 2
    converted = out / "starts" / "small.npz"
    before = converted.stat().st_mtime_ns
    with pytest.raises(BadInputError, match="starts over"):  # another seed; files are read first
        measure(repository, out, resume=True, seed=1)
    assert converted.stat().st_mtime_ns == before
    own = Repository(out / "theirs", repository.robots, repository.model)
    shutil.copytree(repository.folder, own.folder)
    own.pickle_starts(5, seed=1)
    with pytest.raises(BadInputError, match="made with another starts"):
        measure(own, out, resume=True)
    assert converted.stat().st_mtime_ns != before


def copy(repository: Repository, folder: Path) -> Repository:
    """Copy a repository and its robots."""
    shutil.copytree(repository.folder, folder / "theirs")
    shutil.copytree(repository.robots, folder / "robots")
    return Repository(folder / "theirs", folder / "robots", repository.model)


@pytest.mark.scale
def test_bodies_are_measured_by_processes_as_by_one(repository, tmp_path):
    own = copy(repository, tmp_path)
    robot = load_robot(own.robots / SMALL.name)
    (robot.folder / "policies").mkdir()
    save_policy(robot.folder / "policies" / "still.onnx", robot)
    found = [
        drop_wall_times(as_kept(measure(own, tmp_path / engine, engine=engine)))
        for engine in ("local:1", "local:2")
    ]
    played = [case for name, case in found[0]["cases"].items() if "still" in name]
    peaks = {case["peak_torque_nm"]["median"] for case in played}
    assert len(peaks) == len(played) == 2  # figures depend on the falls
    assert found[1] == found[0]


def test_a_worker_loads_the_body_of_its_part_and_imports_nothing(result, out, repository, tmp_path):
    own = copy(repository, tmp_path)
    shutil.copytree(out / "starts", tmp_path / "out" / "starts")
    request = BenchBodies(folder=own.folder, robots=own.robots, out=tmp_path / "out", n=1, starts=2)
    work = spread_bodies(request, (replace(SMALL, name="tall"), SMALL)).work  # one has no files
    starts, model = tmp_path / "out" / "starts" / "small.npz", SMALL.find_model(own.folder)
    part = f"{CASES[0]} 1 to 2"
    for path in (starts, own.robots / "small", model):
        moved = path.rename(tmp_path / "moved")
        with pytest.raises(BadInputError, match=f"{path} is missing on .*, expected that with"):
            work(part)
        assert not path.exists()
        moved.rename(path)
    description = own.robots / "small" / "robot.toml"
    before = description.read_text()
    description.write_text(f"{before}# changed\n")
    with pytest.raises(BadInputError, match=f"{own.robots / 'small'} is another one on"):
        work(part)
    description.write_text(before)
    done = work(part)
    assert isinstance(done, BodyRises)
    assert len(done.rises) == result.cases[CASES[0]].n


@dataclass(frozen=True)
class Runs:
    command: str

    def __reduce__(self):
        return os.system, (self.command,)


def test_a_pickle_that_would_run_something_is_refused_and_nothing_is_written(repository, tmp_path):
    own = Repository(tmp_path / "theirs", repository.robots, repository.model)
    shutil.copytree(repository.folder, own.folder)
    bad = [[np.zeros(3), Runs(f"touch {tmp_path / 'ran'}")]]
    SMALL.find_starts(own.folder).write_bytes(pickle.dumps(bad))
    with pytest.raises(BadInputError) as caught:
        measure(own, tmp_path / "out")
    (problem,) = caught.value.problems
    assert problem.startswith(f"{SMALL.find_starts(own.folder)}: it names ")
    assert not (tmp_path / "ran").exists()
    assert not (tmp_path / "out").exists()


def test_a_folder_that_is_no_copy_is_refused(repository, tmp_path):
    own = Repository(tmp_path, repository.robots, repository.model)
    with pytest.raises(BadInputError, match="no copy of github"):
        measure(own, tmp_path / "out")
    SMALL.find_model(tmp_path).parent.mkdir(parents=True)
    SMALL.find_model(tmp_path).write_text("<mujoco/>")
    with pytest.raises(BadInputError, match=f"{SMALL.find_starts(tmp_path)}: no such file"):
        measure(own, tmp_path / "out")
    with pytest.raises(BadInputError, match="--bodies is 'tall', expected small"):
        measure(repository, tmp_path / "out", bodies=("tall",))


@pytest.mark.parametrize(
    ("shares", "stood", "ending", "in_time", "at_end"),
    [
        ([0.3] * 400 + [1.0] * 300, True, Ending.DONE, True, True),
        ([0.3] * 800 + [1.0] * 300, True, Ending.DONE, False, True),  # later than 5 s
        ([0.3] * 300 + [1.0] * 100, True, Ending.DONE, True, True),  # held, and so still up at 5 s
        ([0.3] * 300 + [1.0] * 100, False, Ending.FAULT, False, False),
        ([1.0] * 700 + [0.3], False, Ending.DONE, True, False),
        ([], False, Ending.DONE, False, False),
    ],
)
def test_a_head_counts_at_five_seconds_and_at_the_end(shares, stood, ending, in_time, at_end):
    qpos = np.array(shares).reshape(-1, 1)
    rise = SimpleNamespace(
        outcome=SimpleNamespace(qpos=qpos, record=SimpleNamespace(period=0.008)),
        run=SimpleNamespace(ending=ending),
        attempts=[SimpleNamespace(abort=None)],
        stood=stood,
        figures=lambda: SimpleNamespace(start_class="prone", reason="", attempts=1, stood=stood),
    )
    gauge = SimpleNamespace(measure=lambda row: float(row[0]))
    found = BodyRise.of(rise, gauge, "prone")
    assert (found.head_in_time, found.head_at_end) == (in_time, at_end)
    assert found.head_share == (shares[-1] if shares else None)
