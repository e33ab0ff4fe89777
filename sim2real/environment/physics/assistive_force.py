"""The curriculum of the assistive force: it fades as more robots stand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# Hard falls are drawn more often: a success rate of 0.45 means more than half of all falls.
FORCE_EPISODES, FORCE_SUCCESS, FORCE_STEP = 200, 0.45, 0.05


@dataclass(eq=False)
class AssistiveForce:
    """Upper limit of the force that lifts robots; field names are those of the checkpoint."""

    lift: float
    """Upper limit, as a fraction of the weight."""
    first: float
    """Initial upper limit."""
    ended: int = 0
    stood: int = 0

    @property
    def cost_share(self) -> float:
        """Return the factor on costs: it grows from 0 to 1 as the force fades."""
        return 1.0 - self.lift / self.first if self.first else 1.0

    def note(self, stood: NDArray[np.bool_]) -> None:
        """Count episodes; reduce the force after enough of them if most ended in a stand."""
        self.ended += len(stood)
        self.stood += int(stood.sum())
        if self.ended < FORCE_EPISODES:
            return
        if self.stood > FORCE_SUCCESS * self.ended:
            self.lift = max(self.lift - FORCE_STEP, 0.0)
        self.ended = self.stood = 0
