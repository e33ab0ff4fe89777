"""Rises on the bodies of others: both measures, from a folder, and no program of a pickle."""

import json
import os
import pickle
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
import rise_on_bodies
from rise_on_bodies import FEET, HEAD, HEADS, BodyOptions, HeadGauge, is_up, measure_heads
from small_repository import NAME, Repository, make_repository

from drivers import Ending
from robots import load_robot


@pytest.fixture(scope="module")
def repository(tmp_path_factory: pytest.TempPathFactory) -> Repository:
    return make_repository(tmp_path_factory.mktemp("bodies"))


@pytest.fixture(autouse=True)
def small_body(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(HEADS, NAME, 0.58)


@pytest.mark.slow
def test_a_body_without_motions_is_counted_with_honest_zeros(repository: Repository, tmp_path):
    file = tmp_path / "bodies.json"
    options = BodyOptions(
        folder=repository.folder,
        robots=repository.robots,
        bodies=(NAME,),
        n=1,
        starts=2,
        json=file,
        ledger=tmp_path / "ledger.jsonl",
    )
    rise_on_bodies.main(options)
    result = json.loads(file.read_text())
    assert result["without_motions"] == [NAME]
    assert {name: case["n"] for name, case in result["cases"].items()} == {
        "small: plan, their starts": 2,
        "small: plan, falls": 4,
    }
    case = result["cases"]["small: plan, falls"]
    assert (case["stood"], case["head_in_time"], case["head_at_end"]) == (0, 0, 0)
    assert list(case["classes"]) == ["supine", "prone", "left", "right"]
    assert case["failures"][0].startswith("1, supine: ")
    rise_on_bodies.main(options)  # all from the ledger
    assert json.loads(file.read_text()) == result


@dataclass(frozen=True)
class Runs:
    command: str

    def __reduce__(self):
        return os.system, (self.command,)


def test_a_pickle_that_would_run_something_is_refused(tmp_path: Path):
    file = tmp_path / "starts.pkl"
    file.write_bytes(pickle.dumps([[np.zeros(3), Runs(f"touch {tmp_path / 'ran'}")]]))
    with pytest.raises(pickle.UnpicklingError, match=r"it names posix\.system, expected numpy"):
        rise_on_bodies.read_pickle(file)
    assert not (tmp_path / "ran").exists()
    file.write_bytes(pickle.dumps([[np.arange(3.0), np.zeros(0)]]))
    assert rise_on_bodies.read_pickle(file)[0][0].tolist() == [0.0, 1.0, 2.0]


@pytest.fixture(scope="module")
def model(repository: Repository) -> mujoco.MjModel:
    return load_robot(repository.robots / NAME).spec().compile()


def test_the_height_is_that_of_the_source_model_in_any_posture(repository, model):
    source = repository.model
    gauge = HeadGauge(source, model, 0.5)
    rng, data = np.random.default_rng(0), mujoco.MjData(source)
    for _ in range(20):
        data.qpos[:3] = rng.uniform(-1.0, 1.0, 3)
        data.qpos[3:7] = rng.normal(size=4)
        data.qpos[7:] = rng.uniform(-1.0, 1.0, source.nq - 7)
        mujoco.mj_kinematics(source, data)
        qpos = np.zeros(model.nq)
        qpos[:7] = data.qpos[:7]
        for joint in range(1, source.njnt):
            own = model.joint(source.joint(joint).name)
            qpos[own.qposadr[0]] = data.qpos[source.jnt_qposadr[joint]]
        feet = np.mean([data.site(name).xpos[2] for name in FEET])
        assert gauge.measure(qpos) == pytest.approx((data.site(HEAD).xpos[2] - feet) / 0.5)


def test_a_model_with_another_torso_frame_is_refused(repository):
    moved = load_robot(repository.robots / NAME).spec()
    moved.body("head").pos[2] += 0.01
    with pytest.raises(ValueError, match="site 'camera' is 10 mm from its place"):
        HeadGauge(repository.model, moved.compile(), 0.5)


def test_a_head_counts_at_five_seconds_and_at_the_end():
    """Within a fifth of its standing height it is up."""
    shares = (0.79, 0.81, 1.0, 1.19, 1.21)
    assert [is_up(share) for share in shares] == [False, True, True, True, False]
    for shares, stood, ending, in_time, at_end in (
        ([0.3] * 400 + [1.0] * 300, True, Ending.DONE, True, True),
        ([0.3] * 800 + [1.0] * 300, True, Ending.DONE, False, True),  # later than 5 s
        ([0.3] * 300 + [1.0] * 100, True, Ending.DONE, True, True),  # held, and so still up at 5 s
        ([0.3] * 300 + [1.0] * 100, False, Ending.FAULT, False, False),
        ([1.0] * 700 + [0.3], False, Ending.DONE, True, False),
        ([], False, Ending.DONE, False, False),
    ):
        record = SimpleNamespace(period=0.008)
        rise = SimpleNamespace(
            outcome=SimpleNamespace(qpos=np.array(shares).reshape(-1, 1), record=record),
            run=SimpleNamespace(ending=ending),
            attempts=[SimpleNamespace(abort=None)],
            stood=stood,
        )
        gauge = SimpleNamespace(measure=lambda row: float(row[0]))
        share = shares[-1] if shares else None
        found = {"head_in_time": in_time, "head_at_end": at_end, "head_share": share}
        assert measure_heads(rise, gauge) == found
