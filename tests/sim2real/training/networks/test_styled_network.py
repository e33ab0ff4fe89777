"""The graph of a styled policy computes what head, pose prior and balance compute in training."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from made_up_rises import make_prior

from humanoid_getup.policy.action import build_posture_spec
from humanoid_getup.policy.observation import UPRIGHT, StyleInput, list_terms
from robots import Robot
from robots.quaternion import Array
from sim2real.environment.action_heads import PriorHead
from sim2real.pose_prior.pose_prior import PosePrior
from sim2real.training.networks.styled_network import StyledNetwork

ROBOTS = 40


class Given(torch.nn.Module):
    """An actor whose outputs are given."""

    def __init__(self, outputs: Array) -> None:
        super().__init__()
        self.outputs = torch.tensor(outputs, dtype=torch.float32)

    def forward(self, _seen: torch.Tensor) -> torch.Tensor:
        return self.outputs


@pytest.fixture(scope="module")
def prior(op3: Robot) -> PosePrior:
    return make_prior(op3)


@pytest.fixture(scope="module")
def head(op3: Robot, prior: PosePrior) -> PriorHead:
    return PriorHead(build_posture_spec(op3), prior)


def run(head: PriorHead, prior: PosePrior, outputs: Array, memory: Array, *features: Array):
    """Run the graph on observations that hold memory, wanted and measured features alone."""
    spec = build_posture_spec(prior.robot)
    terms = tuple(list_terms(prior.robot, spec, StyleInput(memory=len(head.names))))
    ends = np.cumsum([0, *(term.size for term in terms)])
    seen = np.zeros((len(outputs), ends[-1]))
    wanted, measured = (values - UPRIGHT for values in features)
    for name, values in (
        ("last_action", memory),
        ("style_targets", wanted),
        ("style_features", measured),
    ):
        first = ends[[term.name for term in terms].index(name)]
        seen[:, first : first + values.shape[1]] = values
    network = StyledNetwork(Given(outputs), terms, spec, prior)
    with torch.no_grad():
        action, memory = network(torch.tensor(seen, dtype=torch.float32))
    return action.numpy(), memory.numpy()


def draw(head: PriorHead) -> tuple[Array, ...]:
    """Draw outputs, memory, wanted and measured features: of lying robots and of standing ones."""
    rng = np.random.default_rng(0)
    outputs, memory = rng.normal(0.0, 2.0, (2, ROBOTS, len(head.names)))
    stand = UPRIGHT + np.array([1.0, 0.0, 0.0])
    spread = np.linspace(0.0, 1.0, ROBOTS)[:, np.newaxis]
    wanted, measured = stand + spread * rng.normal(0.0, 0.5, (2, ROBOTS, 3))
    return outputs, memory, wanted, measured


def test_it_computes_what_the_head_computes_in_training(head: PriorHead, prior: PosePrior):
    inputs = draw(head)
    assert np.abs(inputs[0]).max() > head.limit, "some outputs are limited"
    for graph, training in zip(run(head, prior, *inputs), head.decode(*inputs), strict=True):
        np.testing.assert_allclose(graph, training, atol=2e-4)
