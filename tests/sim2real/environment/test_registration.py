"""The environment through Gymnasium's registry and Gymnasium's own checks."""

import subprocess
import sys

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium")

from gymnasium.utils.env_checker import check_reset_seed_determinism
from gymnasium.wrappers.vector import RecordEpisodeStatistics

from sim2real.environment.get_up_env import GetUpEnv
from sim2real.environment.registration import NAME, register

SMALL = {"num_envs": 4, "falls": 4, "threads": 1}


@pytest.fixture(scope="module")
def env():
    made = gymnasium.make_vec(
        NAME, vectorization_mode="vector_entry_point", robot="op3", randomization="all", **SMALL
    )
    yield made
    made.close()


def test_the_registry_makes_it(env):
    assert isinstance(env.unwrapped, GetUpEnv)
    assert env.num_envs == 4
    assert env.spec.id == NAME


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


def test_registering_twice_is_harmless(recwarn):
    register()
    register()
    assert not list(recwarn)


def test_gymnasiums_own_check_of_seeds_passes(env):
    check_reset_seed_determinism(env)  # its other checks are for single robots


def test_gymnasiums_wrappers_count_its_episodes(env):
    counting = RecordEpisodeStatistics(env)
    counting.reset(seed=0)
    env.unwrapped.episodes.age[:] = env.unwrapped.longest - 1
    _, reward, _, cut, info = counting.step(np.zeros(env.action_space.shape))
    assert cut.all()
    assert info["episode"]["r"] == pytest.approx(reward)
    assert info["episode"]["l"].tolist() == [1] * 4


def test_unknown_rewards_and_robots_are_named():
    with pytest.raises(ValueError, match="unknown rewards 'gold', expected quick, robust, gentle"):
        gymnasium.make_vec(NAME, rewards="gold", **SMALL)
    with pytest.raises(ValueError, match="unknown robot 'nao'"):
        gymnasium.make_vec(NAME, robot="nao", **SMALL)
