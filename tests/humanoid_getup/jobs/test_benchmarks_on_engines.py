"""Benchmarks give the same figures with several workers as in one process."""

import json
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from paths import REPOSITORY
from rise_figures_of import drop_wall_times

from humanoid_getup.benchmarks import fault_injection, sit
from humanoid_getup.jobs import benchmark as benchmarks
from humanoid_getup.jobs.benchmark import benchmark
from humanoid_getup.jobs.requests.bench import (
    BenchDisturbed,
    BenchFaults,
    BenchMethods,
    BenchMotions,
    BenchScenes,
    BenchSit,
    EngineBench,
)
from humanoid_getup.motions.motion_database import find_motion
from robots import load_robot
from robots.storage.encoding import to_json

pytestmark = pytest.mark.scale  # a minute


def read(request: EngineBench) -> dict[str, Any]:
    """Run a benchmark; return its figures without the wall times of plans."""
    return drop_wall_times(json.loads(to_json(benchmark(request))))


@pytest.fixture
def policy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Name a policy as a file of the working directory, which a worker may not share."""
    shutil.copy(REPOSITORY / "robots" / "op3" / "policies" / "robust.onnx", tmp_path / "mine.onnx")
    monkeypatch.chdir(tmp_path)
    return "mine.onnx"


def test_methods_are_compared_by_processes_as_by_one(policy: str):
    few: dict[str, Any] = {"n": 1, "seed": 4, "ways": (policy, "nearest")}
    here = read(BenchMethods(engine="local:1", **few))
    assert list(here["cases"]) == [policy, "nearest"]
    assert read(BenchMethods(engine="local:2", **few)) == here


def test_scenes_are_measured_by_processes_as_by_one(policy: str, tmp_path: Path):
    scene = tmp_path / "ice.toml"
    scene.write_text("[ground]\nfriction = 0.3\n", "utf-8")
    few: dict[str, Any] = {
        "n": 2,
        "seed": 4,
        "ways": (policy, "nearest"),
        "scenes": ("ice.toml", "rough:easy"),
    }
    here = read(BenchScenes(engine="local:1", **few))
    assert [rise["case"] for rise in here["rises"]] == ["ice.toml"] * 4 + ["rough:easy"] * 4
    assert {rise["way"] for rise in here["rises"]} == {policy, "nearest"}
    assert read(BenchScenes(engine="local:2", **few)) == here


def test_disturbed_worlds_are_measured_by_processes_as_by_one(policy: str):
    few: dict[str, Any] = {"n": 1, "seed": 4, "policies": (policy,), "cases": ("friction 0.3",)}
    here = read(BenchDisturbed(engine="local:1", **few))
    assert f"friction 0.3: {policy}" in here["cases"]
    assert read(BenchDisturbed(engine="local:2", **few)) == here


def test_faults_are_injected_by_processes_as_by_one(monkeypatch: pytest.MonkeyPatch):
    chosen = {name: fault_injection.CASES[name] for name in ("servo dead", "stop key")}
    monkeypatch.setattr(fault_injection, "CASES", chosen)
    here = read(BenchFaults(engine="local:1", n=1))
    assert here["cases"]["servo dead"]["succeeded"] == 0
    assert read(BenchFaults(engine="local:2", n=1)) == here


def test_ways_down_are_measured_by_processes_as_by_one():
    here = read(BenchSit(engine="local:1", n=2, seed=3))
    assert list(here["cases"]) == list(sit.LIMITS)
    peaks = [case["peak_torque_nm"]["median"] for case in here["cases"].values()]
    assert len(set(peaks)) == len(sit.LIMITS)  # each limit was applied
    assert read(BenchSit(engine="local:2", n=2, seed=3)) == here


def test_motions_are_played_by_processes_as_by_one(monkeypatch: pytest.MonkeyPatch):
    motion = find_motion(load_robot("op3"), "supine_wide_sit_up")
    twice = [replace(motion, name=name) for name in ("first", "second")]
    monkeypatch.setattr(benchmarks, "load_database", lambda _: SimpleNamespace(motions=twice))
    few: dict[str, Any] = {"n": 4, "seed": 3, "scene": "slope:8"}  # some plays end standing there
    here = read(BenchMotions(engine="local:1", **few))
    stood = [case["disturbed_succeeded"] for case in here["cases"].values()]
    assert len(set(stood)) == 2  # each is disturbed by draws of its own
    assert read(BenchMotions(engine="local:2", **few)) == here
