"""The environment through Gymnasium's registry and Gymnasium's own checks."""

import subprocess
import sys

import pytest

gymnasium = pytest.importorskip("gymnasium")


from sim2real.environment.registration import NAME

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
