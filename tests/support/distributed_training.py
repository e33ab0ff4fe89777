"""One of the processes of a tiny training; run by torchrun with a folder as argument."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

from robots import load_robot
from sim2real.training.config import Recipe
from sim2real.training.runner import TrainingRunner
from sim2real.training.train import train

TINY = Recipe(
    rewards="quick",
    randomization="all",
    wide=True,
    iterations=4,
    robots=8,
    hidden=(16, 16),
    falls=8,
    lift=0.8,
)


def main(folder: Path) -> None:
    """Train, and note what this process has at the end."""
    runners = list[TrainingRunner]()
    learn = TrainingRunner.learn

    def keep(self: TrainingRunner, *arguments: int) -> None:
        runners.append(self)
        learn(self, *arguments)

    TrainingRunner.learn = keep  # type: ignore[method-assign]
    train(load_robot("op3"), TINY, 0, folder)
    env = runners[0].env.env
    actor = {name: value.tolist() for name, value in runners[0].alg._raw_actor.state_dict().items()}
    found = {
        "actor": actor,
        "robots": env.num_envs,
        "lift": env._force.lift,
        "ended": env._force.ended,
        "success": env.pool.success.tolist(),
        "joint_pos": env.sensed.joint_pos.tolist(),
    }
    (folder / f"process_{os.environ.get('RANK', '0')}.json").write_text(json.dumps(found))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
