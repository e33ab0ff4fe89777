"""PPO with symmetric mini-batches, and an average of the actor's weights for export."""

from __future__ import annotations

from typing import Any

import torch
from rsl_rl.algorithms import PPO
from rsl_rl.extensions import Symmetry
from rsl_rl.models import MLPModel
from rsl_rl.storage import RolloutStorage
from torch.optim.swa_utils import AveragedModel

from sim2real.training.library_threads import torch_threads

AVERAGE = "averaged_actor_state_dict"
"""Key of the averaged weights in a checkpoint."""
UPDATES = "averaged_updates"
"""Key of the number of averaged updates in a checkpoint."""
SHARE = 0.02  # weight of the newest actor in the average, whose memory is some fifty updates


class MirroredBatches(Symmetry):
    """Appends the mirror images of observations and actions to every mini-batch."""

    def compute_loss(
        self, actor: MLPModel, batch: RolloutStorage.Batch, original_batch_size: int
    ) -> torch.Tensor:
        """Return no loss: policies learn symmetry from the mirror images.

        To measure symmetry, rsl-rl evaluates the actor once more for every mini-batch; that
        takes a sixteenth of a training's time.
        """
        del actor, batch, original_batch_size
        return torch.zeros(())


class AveragingPPO(PPO):
    """PPO with an exponential moving average of its actor's weights.

    Each update learns some falls and forgets others, so that the actor after any one update is
    worse than the average. Learning itself continues from the newest weights.
    """

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.threads = torch.get_num_threads()
        """Threads of an update."""
        self.symmetry = MirroredBatches(**kwargs["symmetry_cfg"])
        self.average = _average(self._raw_actor)

    def update(self) -> dict[str, float]:
        """Learn from the collected steps; update the average."""
        with torch_threads(self.threads):
            losses = super().update()
        del losses["symmetry"]
        self.average.update_parameters(self._raw_actor)
        return losses

    def save(self) -> dict[str, Any]:
        """Return the state that a resumed training needs."""
        state = {AVERAGE: self.average.module.state_dict(), UPDATES: int(self.average.n_averaged)}
        return super().save() | state

    def load(self, loaded_dict: dict[str, Any], load_cfg: dict | None, strict: bool) -> bool:
        """Restore a saved state; if only networks are loaded, start a new average."""
        is_resumed = super().load(loaded_dict, load_cfg, strict)
        self.average = _average(self._raw_actor)
        if load_cfg is None:
            self.average.module.load_state_dict(loaded_dict[AVERAGE])
            self.average.n_averaged.fill_(loaded_dict[UPDATES])
        return is_resumed


def _average(actor: torch.nn.Module) -> AveragedModel:
    """Start an average at an actor; the first update replaces it."""

    def mix(average: torch.Tensor, newest: torch.Tensor, updates: torch.Tensor | int) -> Any:
        if not average.is_floating_point():
            return newest
        # The first fifty updates have equal weights.
        return average.lerp(newest, max(SHARE, 1.0 / (int(updates) + 1)))

    return AveragedModel(actor, avg_fn=mix, use_buffers=True)
