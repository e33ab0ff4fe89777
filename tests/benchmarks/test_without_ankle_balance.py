"""A policy without its ankle balance: the same network, but for what balances the robot."""

import numpy as np
import pytest
from benchmark_scripts import load_script

from humanoid_getup.policy.onnx_policy import OnnxPolicy, find_policy
from sim2real.environment.styled.ankle_balance import AnkleBalance


def test_what_is_missing_is_what_the_ankle_balance_adds(op3, tmp_path):
    bare = tmp_path / "without.onnx"
    load_script("without_ankle_balance").main("styled", out=bare)
    whole, bare = (OnnxPolicy.load(file, op3) for file in (find_policy(op3, "styled"), bare))
    terms = {term.name: term.size for term in whole.contract.observation}
    ends = dict(zip(terms, np.cumsum(list(terms.values())), strict=True))
    rng = np.random.default_rng(0)
    observed = rng.normal(0.0, 0.1, (20, whole.contract.observation_size)).astype(np.float32)
    wanted = observed[:, ends["style_targets"] - terms["style_targets"] :][:, :3]
    measured = observed[:, ends["style_features"] - terms["style_features"] :][:, :3]
    measured[:, 0] += 0.9  # neck height of robots that have nearly risen; a view of observed
    (actions, memory), (bare_actions, bare_memory) = whole.act(observed), bare.act(observed)
    added = (actions - bare_actions) * whole.action.scale
    assert added == pytest.approx(AnkleBalance(op3).correct(wanted, measured), abs=1e-5)
    assert np.abs(added).max() > 0.01
    assert memory == pytest.approx(bare_memory, abs=1e-6)


def test_a_policy_without_style_is_refused(tmp_path):
    with pytest.raises(ValueError, match="no ankle balance"):
        load_script("without_ankle_balance").main("robust", out=tmp_path / "without.onnx")
    assert not any(tmp_path.iterdir())
