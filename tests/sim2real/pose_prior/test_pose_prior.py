"""The pose prior decodes what it encodes and fits its robot; its rises are planned once."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch")

from functools import partial

from made_up_rises import make_rises
from nonempty import nonempty

from humanoid_getup.commands.learn.make_prior import PriorRequest, make_prior
from humanoid_getup.engines.executor import make_executor
from humanoid_getup.policy.onnx_policy import OnnxPolicy
from humanoid_getup.progress.callback import Progress, ProgressMonitor
from humanoid_getup.style.features import mirror_features
from robots import Robot
from sim2real.pose_prior import PERIOD, CollectedRise, PosePrior, RiseSet
from sim2real.prior_training.collect import collect_rises, load_policy
from sim2real.prior_training.fit import FitOptions, fit_prior


@pytest.fixture(scope="module")
def rises(op3: Robot) -> RiseSet:
    return make_rises(op3)


@pytest.fixture(scope="module")
def prior(rises: RiseSet) -> PosePrior:
    options = FitOptions(hidden=64, epochs=80, learning_rate=3e-3, batch=32)
    return fit_prior(rises, 0, options)


def test_rises_survive_the_trip_through_a_file(op3, rises, tmp_path):
    file = tmp_path / "rises.npz"
    rises.save(file)
    again = RiseSet.load(file, op3)
    assert again.sources == rises.sources
    assert np.array_equal(again.first, rises.first)
    assert again.qpos == pytest.approx(rises.qpos, abs=1e-6)
    assert again.joint_target == pytest.approx(rises.joint_target, abs=1e-6)
    curves = again.curves(2)
    assert curves.duration == pytest.approx(21 * PERIOD)
    height, _, front = curves.values.T
    assert height[-1] == pytest.approx(1.0, abs=0.01)
    assert np.degrees(front[[0, -1]]) == pytest.approx([0.0, 90.0], abs=0.1)


def test_what_is_encoded_is_decoded(rises, prior):
    latent = prior.encode(rises.joint_pos, rises.features)
    again = prior.decode(latent, rises.features)
    error = np.sqrt(np.mean((again - rises.joint_pos) ** 2))
    spread = np.sqrt(np.mean((rises.joint_pos - rises.pos_mean) ** 2))
    assert error < 0.15 * spread
    assert np.sqrt(np.mean(latent**2, axis=0)) == pytest.approx(1.0)
    # Two joints of the left side move, which is two symmetric and two antisymmetric motions; the
    # knee's are the same size, and the elbow's.
    assert 2 <= prior.size <= 4
    assert set(prior.latent_sign.tolist()) == {-1.0, 1.0}


def test_mirrored_latents_and_targets_decode_to_the_mirror_image(op3, prior):
    rng = np.random.default_rng(0)
    latent, features = rng.normal(size=(30, prior.size)), rng.uniform(0.2, 2.5, (30, 3))
    pos = prior.decode(latent, features)
    mirrored = prior.decode(latent * prior.latent_sign, mirror_features(features))
    assert mirrored == pytest.approx(op3.mirror_joints(pos), abs=1e-5)
    assert np.abs(pos - op3.mirror_joints(pos)).max() > 0.05  # asymmetrical postures are kept


def test_a_prior_survives_the_trip_through_a_file(op3, prior, tmp_path):
    file = tmp_path / "prior.npz"
    prior.save(file)
    again = PosePrior.load(file, op3)
    latent, features = np.ones((2, prior.size)), np.ones((2, 3))
    assert np.array_equal(again.decode(latent, features), prior.decode(latent, features))


def spoil(file: Path, **changes: object) -> None:
    arrays = dict(np.load(file))
    np.savez(file, **(arrays | changes))


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({"robot": "wolf"}, "it is of robot 'wolf', expected 'op3'"),
        ({"joints": "a\nb"}, "its joints are .* not those of 'op3'"),
        ({"pos_std": np.ones(3)}, "pos_std"),
        ({"pos_std": np.full(20, -0.1)}, "pos_std holds -0.1, expected above 0"),
        ({"latent_sign": np.array([1.0, -1.0, 7.0])}, "latent_sign holds another number than 1"),
        ({"decoder_weight1": np.full((64, 64), np.nan)}, "decoder_weight1 holds nan"),
    ],
)
def test_a_prior_that_does_not_fit_is_refused_in_one_line(op3, prior, tmp_path, changes, fault):
    file = tmp_path / "prior.npz"
    prior.save(file)
    spoil(file, **changes)
    with pytest.raises(ValueError, match=f"prior.npz holds no pose prior.*{fault}") as caught:
        PosePrior.load(file, op3)
    assert "\n" not in str(caught.value)


def test_rises_are_not_taken_from_an_unknown_or_styled_policy(op3):
    with pytest.raises(ValueError, match="unknown policy 'none'"):
        load_policy(op3, "none")
    with pytest.raises(ValueError, match="policy 'styled' follows style curves, expected one"):
        load_policy(op3, "styled")


@pytest.mark.slow
def test_what_is_planned_is_kept_and_not_planned_again(op3, tmp_path):
    reports: list[Progress] = []
    monitor = ProgressMonitor(reports.append)

    def collect(seed: int, policies: dict[str, OnnxPolicy]) -> list[CollectedRise]:
        start = partial(make_executor, "local:1")
        return collect_rises(
            op3, "op3", 4, seed, tmp_path, policies, lambda count: start(pieces=count), monitor
        )

    first = collect(3, {})
    assert [report.done for report in reports if report.phase == "rises"][-1] == 4
    planned = [rise for rise in first if rise.source.startswith("planned")]
    assert len(planned) >= 2
    written = {file: file.stat().st_mtime_ns for file in tmp_path.glob("*/*.npz")}
    robust = {"robust": load_policy(op3, "robust")}
    again = collect(3, robust)
    assert {file: file.stat().st_mtime_ns for file in tmp_path.glob("*/*.npz")} == written
    for one, other in nonempty(zip(first, again, strict=False)):
        assert np.array_equal(one.qpos, other.qpos)
    assert {rise.source for rise in again[len(first) :]} <= {"policy: robust"}
    collect(4, {})  # other falls
    assert len(list(tmp_path.iterdir())) == 2


def read_all(folder: Path) -> dict[str, bytes]:
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*.npz")}


@pytest.mark.slow
def test_a_prior_does_not_depend_on_the_engine(tmp_path: Path):
    for name, engine in {"one": "local:1", "two": "local:2"}.items():
        make_prior(
            PriorRequest(out=tmp_path / name, rises=4, policies=(), seed=3, epochs=1, engine=engine)
        )
    found = read_all(tmp_path / "one")
    assert len(found) >= 2 + 2
    assert read_all(tmp_path / "two") == found
