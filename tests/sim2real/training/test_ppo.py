"""PPO's average of actors: equal weights at first, recent ones later, and it survives a save."""

from copy import deepcopy

import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("rsl_rl")

from rsl_rl.models import MLPModel
from rsl_rl.storage import RolloutStorage
from tensordict import TensorDict

from sim2real.training.ppo import AVERAGE, UPDATES, AveragingPPO

ROBOTS, STEPS, INPUTS, OUTPUTS = 4, 8, 3, 2
GAUSSIAN = {"class_name": "GaussianDistribution", "init_std": 1.0, "std_type": "log"}


def mirror(env=None, obs=None, actions=None):
    """Change every sign in the mirror images."""
    del env
    return (
        None if obs is None else torch.cat([obs, TensorDict({"policy": -obs["policy"]}, len(obs))]),
        None if actions is None else torch.cat([actions, -actions]),
    )


def make_ppo(seed: int = 0) -> AveragingPPO:
    torch.manual_seed(seed)
    seen = observe(seed)
    nets = [
        MLPModel(seen, {name: ["policy"]}, name, size, hidden_dims=[4], **more)
        for name, size, more in (
            ("actor", OUTPUTS, {"distribution_cfg": GAUSSIAN}),
            ("critic", 1, {}),
        )
    ]
    storage = RolloutStorage("rl", ROBOTS, STEPS, seen, [OUTPUTS])
    symmetry = {"env": None, "data_augmentation_func": mirror, "use_data_augmentation": True}
    return AveragingPPO(*nets, storage, num_learning_epochs=1, symmetry_cfg=symmetry)


def observe(seed: int) -> TensorDict:
    values = torch.randn(ROBOTS, INPUTS, generator=torch.Generator().manual_seed(seed))
    return TensorDict({"policy": values}, batch_size=[ROBOTS])


def learn(made: AveragingPPO, seed: int) -> dict[str, float]:
    """Collect steps that are rewarded for their number, and learn from them."""
    with torch.inference_mode():
        for step in range(STEPS):
            made.act(observe(seed + step))
            done = torch.zeros(ROBOTS, dtype=torch.bool)
            made.process_env_step(
                observe(seed + step), torch.full((ROBOTS,), float(step)), done, {}
            )
        made.compute_returns(observe(seed))
    return made.update()


def weights(actor) -> torch.Tensor:
    return torch.cat([value.flatten() for value in actor.parameters()]).detach().clone()


def test_the_first_updates_count_alike_in_the_average():
    made, seen = make_ppo(), []
    for update in range(4):
        losses = learn(made, 10 * update)
        seen.append(weights(made.actor))
        assert "symmetry" not in losses
    assert not torch.allclose(seen[0], seen[-1])
    expected = torch.stack(seen).mean(dim=0)
    assert torch.allclose(weights(made.average.module), expected, atol=1e-6)


def test_a_saved_training_continues_with_its_average():
    made, other = make_ppo(), make_ppo(seed=1)
    learn(made, 0)
    learn(made, 10)
    state = deepcopy(made.save())
    assert state[UPDATES] == 2
    other.load(state, None, True)
    assert torch.equal(weights(other.average.module), weights(made.average.module))
    for each in (made, other):
        torch.manual_seed(5)
        learn(each, 20)
    assert torch.equal(weights(other.average.module), weights(made.average.module))


def test_an_actor_that_is_taken_over_begins_its_own_average():
    made, other = make_ppo(), make_ppo(seed=1)
    learn(made, 0)
    learn(made, 10)
    assert not torch.equal(weights(made.actor), weights(made.average.module))
    other.load(made.save(), {"actor": True, "critic": True}, True)
    assert torch.equal(weights(other.average.module), weights(made.actor))
    assert int(other.average.n_averaged) == 0
    assert AVERAGE in other.save()
