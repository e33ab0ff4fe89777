"""The training environment: spaces, seeds, episodes, what critics know, and mirror images."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from nonempty import nonempty

gymnasium = pytest.importorskip("gymnasium")

from gymnasium.vector import AutoresetMode

from robots.kinematics import place
from sim2real.environment.env_options import RANDOMIZATIONS, EnvOptions
from sim2real.environment.episodes import HELD, TO_OPEN
from sim2real.environment.get_up_env import GetUpEnv
from sim2real.environment.registration import NAME
from sim2real.environment.rewards import Reward, stands
from sim2real.environment.starts import StartPool

FALLEN = EnvOptions(robots=8, falls=1.0, ends_early=0.0, threads=1)
STANDING = replace(FALLEN, falls=0.0, motions=0.0)
RANDOM = EnvOptions(robots=8, randomization=RANDOMIZATIONS["all"], threads=2)


def roll(op3, action, pool, options, seed, steps=8):
    """Step with random actions; return observations, critic's views and rewards."""
    env = GetUpEnv(op3, action, StartPool.of(pool.qpos), options)
    observation, info = env.reset(seed=seed)
    seen, rng = [(observation, info["critic"], np.zeros(options.robots))], np.random.default_rng(9)
    for _ in range(steps):
        actions = rng.uniform(-1.0, 1.0, env.action_space.shape)
        observation, reward, _, _, info = env.step(actions)
        seen.append((observation, info["critic"], reward))
    return [np.array(values) for values in zip(*seen, strict=True)]


def test_spaces_hold_what_is_seen_and_done(op3, action, pool):
    env = GetUpEnv(op3, action, pool, RANDOM)
    observation, _ = env.reset(seed=0)
    assert env.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    assert env.observation_space.contains(observation)
    assert env.single_observation_space.shape == (sum(term.size for term in env.terms),)
    assert env.single_action_space.shape == (action.size,)
    for _ in range(3):
        observation, reward, ended, cut, _ = env.step(env.action_space.sample())
        assert env.observation_space.contains(observation)
        assert [part.shape for part in (reward, ended, cut)] == [(8,)] * 3
        assert not ended.any()


@pytest.mark.parametrize("options", [FALLEN, RANDOM])
def test_one_seed_is_one_story_and_another_seed_another(op3, action, pool, options):
    one = roll(op3, action, pool, options, 3)
    again = roll(op3, action, pool, replace(options, threads=3 - options.threads), 3)
    other = roll(op3, action, pool, options, 4)
    for first, second, third in nonempty(zip(one, again, other, strict=True)):
        assert np.array_equal(first, second)
        assert not np.array_equal(first, third)


def test_an_episode_ends_by_time_and_the_next_begins_in_the_same_step(op3, action, pool):
    env = GetUpEnv(op3, action, pool, FALLEN)
    env.reset(seed=0)
    env.episodes.age[:4] = env.longest - 2
    idle = np.zeros((8, action.size))
    _, _, _, cut, _ = env.step(idle)
    assert not cut.any()
    observation, _, ended, cut, info = env.step(idle)
    assert cut.tolist() == [True] * 4 + [False] * 4
    assert not ended.any()
    assert info["falls"] == 4
    assert np.array_equal(info["_final_obs"], cut)
    assert not np.array_equal(info["final_obs"][:4], observation[:4])
    assert np.array_equal(info["final_obs"][4:], observation[4:])
    assert env.episodes.age.tolist() == [0] * 4 + [2] * 4
    start = (env.terms[0].size + env.terms[1].size) + np.arange(op3.n)
    seen = observation[:4, start] + op3.standing.joint_pos
    known = pool.qpos[:, op3.layout(env.sim.model).qpos]
    for row in seen:
        assert np.abs(known - row).max(axis=1).min() < 1e-5


def test_a_robot_whose_simulation_diverges_earns_nothing_and_is_reset(
    op3, action, pool, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)  # where MuJoCo writes its log
    env = GetUpEnv(op3, action, pool, replace(STANDING, rewards=(Reward(stands, 1.0),)))
    env.reset(seed=0)
    idle = np.zeros((8, action.size))
    env.step(idle)
    env.sim.push(np.array([2]), np.full((1, 3), np.nan))
    observation, reward, _, cut, info = env.step(idle)
    assert reward.tolist() == [1.0, 1.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0]
    assert np.flatnonzero(cut).tolist() == [2]
    assert env.episodes.age.tolist() == [2, 2, 0, 2, 2, 2, 2, 2]
    assert info["stood"] == 0
    seen = (observation, info["final_obs"], info["critic"])
    assert all(np.isfinite(values).all() for values in seen)
    assert not env.step(idle)[3].any()


def test_episodes_begin_on_the_way_first_and_do_not_count_as_falls(op3, action, pool):
    model = GetUpEnv(op3, action, pool, FALLEN).sim.model
    standing = np.tile(place(op3, model, op3.standing), (4, 1))
    qpos, fallen = np.concatenate([standing, pool.qpos]), np.arange(4 + len(pool.qpos)) >= 4
    mixed = StartPool.of(qpos, fallen.astype(int), fallen)
    env = GetUpEnv(op3, action, mixed, replace(FALLEN, ends_early=1.0))
    env.reset(seed=0)
    infos = [env.step(np.zeros((8, action.size)))[4]]
    while infos[-1]["level"] == 0:
        infos.append(env.step(np.zeros((8, action.size)))[4])
    assert len(infos) == pytest.approx(TO_OPEN / 8 * HELD / env.step_time, rel=0.1)
    assert all(info["falls"] == 0 for info in infos)  # standing at the start proves nothing
    env.episodes.age[:] = env.longest - 1
    info = env.step(np.zeros((8, action.size)))[4]
    assert 0 < info["falls"] < 8
    assert info["stood"] == 0


def test_the_critic_sees_the_observation_and_then_the_truth(op3, action, pool):
    env = GetUpEnv(op3, action, pool, STANDING)
    env.reset(seed=0)
    observation, _, _, _, info = env.step(np.zeros((8, action.size)))
    known, size = info["critic"], observation.shape[1]
    assert np.array_equal(known[:, :size], observation)
    assert known.shape[1] == len(env.mirrors[1].index)
    neck, left, right, distance, upright, foreign = known[0, size : size + 6]
    assert neck == pytest.approx(1.0, abs=0.02)
    assert [left, right] == pytest.approx([0.0, 0.0], abs=0.02)
    assert distance < 0.2
    assert upright == pytest.approx(1.0, abs=0.01)
    assert foreign == 0.0


@pytest.mark.parametrize("options", [FALLEN, RANDOM])
def test_a_restored_environment_continues_to_the_bit(op3, action, pool, options):
    env = GetUpEnv(op3, action, pool, options)
    env.reset(seed=0)
    env.episodes.age[:] = env.longest - np.arange(8)
    rng = np.random.default_rng(0)
    plan = rng.uniform(-1.0, 1.0, (9, 8, action.size))
    for actions in plan[:3]:
        env.step(actions)
    state = env.save_state()

    other = GetUpEnv(op3, action, StartPool.of(pool.qpos), options)
    other.reset(seed=5)
    other.restore_state(state)
    for actions in nonempty(plan[3:]):
        one, another = env.step(actions), other.step(actions)
        assert all(np.array_equal(one[k], another[k]) for k in (0, 1, 3))
        assert np.array_equal(one[4]["critic"], another[4]["critic"])


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


SMALL = {"num_envs": 4, "falls": 4, "threads": 1}


def test_a_user_who_imported_nothing_else_gets_it():
    program = (
        f"import gymnasium\n"
        f"name = 'sim2real.environment.registration:{NAME}'\n"
        f"env = gymnasium.make_vec(name, num_envs=2, falls=2, threads=1)\n"
        f"print(env.reset(seed=0)[0].shape[0])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.stdout == "2\n", done.stderr


def test_importing_the_package_needs_no_gymnasium():
    program = (
        "import sys, sim2real\nassert not {'gymnasium', 'torch', 'mujoco'} & set(sys.modules)\n"
    )
    subprocess.run([sys.executable, "-c", program], check=True)


def test_unknown_rewards_and_robots_are_named():
    with pytest.raises(ValueError, match="unknown rewards 'gold', expected quick, robust, gentle"):
        gymnasium.make_vec(NAME, rewards="gold", **SMALL)
    with pytest.raises(ValueError, match="unknown robot 'nao'"):
        gymnasium.make_vec(NAME, robot="nao", **SMALL)
