"""Policies are evaluated by several workers as by one process."""

import shutil
from pathlib import Path
from typing import Any

import pytest
from paths import REPOSITORY

from humanoid_getup.jobs.evaluate_policy import evaluate
from humanoid_getup.jobs.requests.learning import EvaluateRequest
from humanoid_getup.progress.callback import Progress
from robots.storage.encoding import to_json
from sim2real import perturbations

pytestmark = pytest.mark.scale


@pytest.fixture
def policy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Name a policy as a file of the working directory, which a worker may not share."""
    shutil.copy(REPOSITORY / "robots" / "op3" / "policies" / "robust.onnx", tmp_path / "mine.onnx")
    monkeypatch.chdir(tmp_path)
    return "mine.onnx"


@pytest.mark.parametrize(("engine", "package"), [("local:2", "mujoco"), ("dask:2", "distributed")])
def test_rises_and_what_is_random_about_them_do_not_depend_on_the_workers(
    policy: str, engine: str, package: str, monkeypatch: pytest.MonkeyPatch
):
    pytest.importorskip(package)
    monkeypatch.setattr(perturbations, "CHUNK", 4)  # two pieces of level ground
    done: dict[str, float] = {}

    def report(progress: Progress) -> None:
        assert progress.done >= done.get(progress.phase, 0.0)
        done[progress.phase] = progress.done

    some: dict[str, Any] = {"policy": policy, "n": 8, "push": 0.3, "weak_servo": 0.7, "seed": 3}
    scenes = "flat,rough:easy"
    here = evaluate(EvaluateRequest(scene=scenes, engine="local:1", **some))
    there = evaluate(EvaluateRequest(scene=scenes, engine=engine, **some), report)
    assert [case.all.n for case in here.cases.values()] == [8, 8]
    assert to_json(there) == to_json(here)
    for phase in ("falls (rough:easy)", "rises (flat)", "rises (rough:easy)"):
        assert done[phase] == pytest.approx(8.0)
