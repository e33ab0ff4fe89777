"""Left and right exchanged in starts and actions, all that follows is exchanged."""

import numpy as np
import pytest

pytest.importorskip("gymnasium")

from sim2real.environment.env_options import EnvOptions
from sim2real.environment.get_up_env import GetUpEnv
from sim2real.environment.starts.start_pool import StartPool

# The OP3 is not quite symmetric: its torso's center of mass is 0.13 mm to one side. In the
# air that makes up to 0.005 in an observation, whose joint speeds are about 5.
ASYMMETRY = 0.01


class Pairs(StartPool):
    """Hands out its starts in order: a fall, and in the other half its mirror image."""

    def draw(self, count, rng, highest=0):
        del rng, highest
        return np.arange(count)


def make_pairs(op3, action, qpos):
    options = EnvOptions(robots=len(qpos), falls=1.0, threads=1)
    env = GetUpEnv(op3, action, Pairs(**vars(StartPool.of(qpos))), options)
    observation, info = env.reset(seed=0)
    return env, observation, info["critic"]


def test_mirrored_falls_look_mirrored_to_actor_and_critic(op3, action, falls):
    env, seen, known = make_pairs(op3, action, falls)
    mirror, critic, _ = env.mirrors
    assert mirror(seen[:8]) == pytest.approx(seen[8:], abs=1e-5)
    assert critic(known[:8]) == pytest.approx(known[8:], abs=1e-5)
    assert np.abs(known[:8] - known[8:]).max() > 0.5
    assert np.array_equal(critic(critic(known)), known)


def test_mirrored_actions_have_mirrored_consequences(op3, action, world, falls):
    # In the air, limbs apart: where contacts begin, rounding grows into chaos.
    flying = falls.copy()
    flying[:, 2] += 2.0
    spread = op3.standing.joint_pos.copy()
    left, right = (op3.joint_names.index(f"{side}_hip_roll") for side in "lr")
    spread[[left, right]] += (-0.4, 0.4)  # the soles 0.28 m apart
    flying[:, op3.layout(world.model).qpos] = spread
    env, _, _ = make_pairs(op3, action, flying)
    mirror, critic, _ = env.mirrors
    sign, rng = action.mirror_sign(op3), np.random.default_rng(0)
    largest = 0.0
    for _ in range(6):
        numbers = rng.uniform(-0.5, 0.5, (8, action.size))
        seen, reward, _, _, info = env.step(np.concatenate([numbers, numbers * sign]))
        known = info["critic"]
        assert mirror(seen[:8]) == pytest.approx(seen[8:], abs=ASYMMETRY)
        assert critic(known[:8]) == pytest.approx(known[8:], abs=ASYMMETRY)
        assert reward[:8] == pytest.approx(reward[8:], abs=1e-4)
        largest = max(largest, float(np.abs(seen).max()))
    assert largest > 3.0


def test_on_the_ground_mirrored_robots_are_rewarded_alike(op3, action, falls):
    env, _, _ = make_pairs(op3, action, falls)
    sign, rng = action.mirror_sign(op3), np.random.default_rng(0)
    for _ in range(10):
        numbers = rng.uniform(-1.0, 1.0, (8, action.size))
        _, reward, _, _, _ = env.step(np.concatenate([numbers, numbers * sign]))
        assert reward[:8] == pytest.approx(reward[8:], abs=0.02)
