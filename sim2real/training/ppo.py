"""Averaging: what leaves a training is the mean of the policies that it went through lately."""

from __future__ import annotations

from typing import Any

import torch
from rsl_rl.algorithms import PPO
from rsl_rl.extensions import Symmetry
from rsl_rl.models import MLPModel
from rsl_rl.storage import RolloutStorage


class MirroredBatches(Symmetry):
    """Appends the mirror images of what was seen to every mini-batch."""

    def compute_loss(
        self, actor: MLPModel, batch: RolloutStorage.Batch, original_batch_size: int
    ) -> torch.Tensor:
        """Return no loss: policies learn symmetry from the mirror images.

        To tell how symmetric a policy is, rsl-rl asks it once more for every mini-batch; that
        is a sixteenth of a training's time.
        """
        del actor, batch, original_batch_size
        return torch.zeros(())


AVERAGE = "averaged_actor_state_dict"
"""Where a checkpoint holds the averaged policy."""
UPDATES = "averaged_updates"
"""Where it holds how many updates the average has seen."""
SHARE = 0.02  # of the newest policy in the average, which looks back on some fifty updates

Weights = dict[str, torch.Tensor]


class AveragingPPO(PPO):
    """PPO that keeps a running mean of its actor's weights beside them.

    Each update learns some falls and forgets others, so that a policy taken at any moment is
    worse than those around it. Learning itself goes on from the newest weights.
    """

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.symmetry = MirroredBatches(**kwargs["symmetry_cfg"])
        self.average, self.updates = _copy(self._raw_actor), 0

    def update(self) -> dict[str, float]:
        """Learn from what was seen, and let the average follow."""
        losses = super().update()
        del losses["symmetry"]
        newest = _copy(self._raw_actor)
        self.updates += 1
        # At first all count alike; what was there before the first update does not.
        share = max(SHARE, 1.0 / self.updates)
        self.average = {
            name: value.lerp(newest[name], share) if value.is_floating_point() else newest[name]
            for name, value in self.average.items()
        }
        return losses

    def save(self) -> dict[str, Any]:
        """Return all that a resumed training needs."""
        return super().save() | {AVERAGE: self.average, UPDATES: self.updates}

    def load(self, loaded_dict: dict[str, Any], load_cfg: dict | None, strict: bool) -> bool:
        """Go on from what was saved; where only networks are taken over, average anew."""
        goes_on = super().load(loaded_dict, load_cfg, strict)
        if load_cfg is None:
            self.average, self.updates = loaded_dict[AVERAGE], loaded_dict[UPDATES]
        else:
            self.average, self.updates = _copy(self._raw_actor), 0
        return goes_on


def _copy(actor: torch.nn.Module) -> Weights:
    return {name: value.detach().clone() for name, value in actor.state_dict().items()}
