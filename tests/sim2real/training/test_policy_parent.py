"""A policy file as the parent of a training: of this robot, sound, and of the recipe's kind."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch")
onnx = pytest.importorskip("onnx")

from humanoid_getup.policy.onnx_file import CHECKSUM_ENTRY, read_model, seal_model
from robots import Robot
from sim2real.training.config import RECIPES
from sim2real.training.policy_parent import check_policy_parent, is_policy_file


def shipped(robot: Robot, name: str) -> Path:
    return robot.folder / "policies" / f"{name}.onnx"


def test_a_policy_of_the_recipes_actions_begins_a_training(op3: Robot):
    check_policy_parent(shipped(op3, "robust"), op3, RECIPES["rough"])
    assert is_policy_file(shipped(op3, "robust"))
    assert not is_policy_file(op3.folder)


@pytest.mark.parametrize(
    ("policy", "recipe", "message"),
    [
        ("robust", "styled", "follows no style curves, expected a policy that does"),
        ("styled", "rough", "follows style curves, expected a policy that does not"),
        ("quick", "rough", "it has actions .*; expected"),
    ],
)
def test_a_policy_of_another_kind_is_refused(op3: Robot, policy: str, recipe: str, message: str):
    with pytest.raises(match=message):
        check_policy_parent(shipped(op3, policy), op3, RECIPES[recipe])


def test_a_policy_that_holds_nan_cannot_begin_a_training(op3, tmp_path):
    bare = read_model(op3.folder / "policies" / "robust.onnx").rpartition(CHECKSUM_ENTRY)[0]
    model = onnx.load_model_from_string(bare)
    (weight,) = (v for v in model.graph.initializer if v.name.endswith("mlp.0.weight"))
    spoilt = np.full_like(onnx.numpy_helper.to_array(weight), np.nan)
    weight.CopyFrom(onnx.numpy_helper.from_array(spoilt, weight.name))
    file = tmp_path / "nan.onnx"
    file.write_bytes(seal_model(model.SerializeToString()))
    with pytest.raises(match="its network holds NaN or infinity"):
        check_policy_parent(file, op3, RECIPES["rough"])
