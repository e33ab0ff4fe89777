"""One of the processes of a tiny training, run by torchrun.

Arguments: the folder, the number of iterations, and a policy file as the parent, if there is one.
"""

from __future__ import annotations

import json
import os
import sys
from dataclasses import replace
from pathlib import Path

from torch import nn

from robots import load_robot
from sim2real.training.config import Recipe
from sim2real.training.runner import TrainingRunner
from sim2real.training.train import Training

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


def main(folder: Path, iterations: int, parent: Path | None) -> None:
    """Train, and note what this process has at the beginning and at the end."""
    runners, begun = list[TrainingRunner](), dict[str, object]()
    learn = TrainingRunner.learn

    def keep(self: TrainingRunner, iterations: int) -> None:
        runners.append(self)
        begun.update(note_curricula(self), critic=note_weights(self.alg._raw_critic))
        learn(self, iterations)

    TrainingRunner.learn = keep  # type: ignore[method-assign]
    recipe = replace(TINY, iterations=iterations)
    Training(robot=load_robot("op3"), recipe=recipe, folder=folder, parent=parent).run()
    env = runners[0].env.env
    found = note_curricula(runners[0]) | {
        "begun": begun,
        "actor": note_weights(runners[0].alg._raw_actor),
        "robots": env.num_envs,
        "joint_pos": env.sensed.joint_pos.tolist(),
    }
    (folder / f"process_{os.environ.get('RANK', '0')}.json").write_text(json.dumps(found))


def note_curricula(runner: TrainingRunner) -> dict[str, object]:
    """Note how far the curricula have come."""
    env = runner.env.env
    return {
        "lift": env._force.lift,
        "ended": env._force.ended,
        "success": env.pool.success.tolist(),
    }


def note_weights(network: nn.Module) -> dict[str, list[float]]:
    """Note the weights and statistics of a network."""
    return {name: value.tolist() for name, value in network.state_dict().items()}


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3]) if sys.argv[3:] else None)
