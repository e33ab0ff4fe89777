"""A symmetric network answers a mirrored observation with the mirrored outputs, also as a graph."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from tensordict import TensorDict

from humanoid_getup.policy.observation import Mirror
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
