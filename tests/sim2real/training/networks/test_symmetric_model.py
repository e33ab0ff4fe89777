"""A symmetric network answers a mirrored observation with the mirrored outputs, also as a graph."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from tensordict import TensorDict

from humanoid_getup.policy.observation import Mirror
from sim2real.training.networks.extension import extend_inputs
from sim2real.training.networks.symmetric_model import SymmetricModel, as_exchange

INPUTS = Mirror(np.array([1, 0, 2, 3]), np.array([1.0, 1.0, -1.0, 1.0]))
OUTPUTS = Mirror(np.array([1, 0]), np.array([-1.0, -1.0]))


def make_model(inputs: Mirror = INPUTS) -> SymmetricModel:
    torch.manual_seed(0)
    return SymmetricModel(
        pack(torch.zeros(1, len(inputs.index))),
        {"actor": ["policy"]},
        "actor",
        2,
        hidden_dims=[8, 8],
        obs_normalization=True,
        inputs=as_exchange(inputs),
        outputs=as_exchange(OUTPUTS),
    )


def pack(values) -> TensorDict:
    return TensorDict({"policy": values}, batch_size=[len(values)])


def mirror(values, exchange: Mirror):
    return values[:, torch.as_tensor(exchange.index)] * torch.tensor(exchange.sign).float()


def test_mirrored_observations_have_mirrored_outputs():
    model, seen = make_model(), torch.randn(30, 4) * torch.tensor([1.0, 3.0, 2.0, 5.0]) + 1.0
    model.update_normalization(pack(seen))
    outputs = model(pack(seen))
    assert torch.allclose(model(pack(mirror(seen, INPUTS))), mirror(outputs, OUTPUTS), atol=1e-6)
    assert float((outputs - mirror(outputs, OUTPUTS)).detach().abs().max()) > 0.01
    exported = model.as_onnx(verbose=False)
    assert torch.allclose(exported(seen), outputs, atol=1e-6)


def test_frozen_statistics_stay_as_they_are():
    model = make_model()
    model.update_normalization(pack(torch.randn(30, 4)))
    model.obs_normalizer.until = 1
    before = model.obs_normalizer.normalizer.mean.clone()
    model.update_normalization(pack(torch.randn(30, 4) + 9.0))
    assert torch.equal(model.obs_normalizer.normalizer.mean, before)


def test_more_inputs_change_nothing_at_first():
    model, seen = make_model(), torch.randn(30, 4) + 1.0
    model.update_normalization(pack(seen))
    # Three new inputs before the last one.
    moved = Mirror(np.array([1, 0, 2, 4, 3, 5, 6]), np.array([1.0, 1.0, -1.0, 1.0, 1.0, 1.0, 1.0]))
    wider = make_model(moved)
    wider.load_state_dict(extend_inputs(model.state_dict(), wider, 3, 0.05))
    new = torch.randn(30, 3)
    both = torch.cat([seen[:, :3], new, seen[:, 3:]], dim=1)
    assert torch.allclose(wider(pack(both)), model(pack(seen)), atol=1e-6)
    assert torch.allclose(
        wider(pack(mirror(both, moved))), mirror(wider(pack(both)), OUTPUTS), atol=1e-6
    )
    normalized = wider.obs_normalizer(both)[:, 3:6]
    assert torch.allclose(normalized, new / 0.06, atol=1e-5)  # rsl-rl adds 0.01
