"""Without a prior, the latent parameters are the joint angles of both sides."""

import numpy as np
import pytest
from benchmark_scripts import load_script

pytest.importorskip("torch")

from made_up_rises import make_rises

from humanoid_getup.style.features import mirror_features
from sim2real.prior_training.fit import Postures


def test_a_prior_of_joint_angles_decodes_what_it_encodes_and_is_symmetric(op3):
    rises = make_rises(op3)
    postures = Postures.of(rises)
    prior = load_script("style_ablations").make_joint_prior(postures)
    assert prior.size == op3.n
    rng = np.random.default_rng(0)
    pos = prior.pos_mean + prior.pos_std * rng.uniform(-2.0, 2.0, (30, op3.n))
    features = rng.uniform(0.2, 2.5, (30, 3))
    latent = prior.encode(pos, features)
    assert prior.decode(latent, features) == pytest.approx(pos, abs=2e-3)
    assert np.sum(latent**2, axis=1) == pytest.approx(
        np.sum(((pos - prior.pos_mean) / prior.pos_std) ** 2, axis=1), rel=0.01
    )
    mirrored = prior.decode(latent * prior.latent_sign, mirror_features(features))
    assert mirrored == pytest.approx(op3.mirror_joints(pos), abs=2e-3)


def test_return_rates_are_drawn_for_flat_ground_and_terrain(tmp_path):
    script = load_script("style_ablations")
    folders = {name: tmp_path / name for name in ("whole", "terrain", "not trained")}
    for number, folder in enumerate(list(folders.values())[:2]):
        folder.mkdir()
        rows = "".join(f"{k * 512},{0.5 + 0.01 * number * k}\n" for k in range(1, 16))
        (folder / script.PROGRESS).write_text(f"steps,return_rate\n{rows}")
    script.draw(folders, tmp_path / "rates.png")
    assert (tmp_path / "rates.png").read_bytes().startswith(b"\x89PNG")


def test_each_ablation_changes_something():
    ablations = load_script("style_ablations").list_ablations()
    kinds = list(map(repr, ablations.values()))
    assert len(set(kinds)) == len(ablations) == 10
