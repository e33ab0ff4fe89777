"""Gymnasium's registry knows the environment: ``gymnasium.make_vec("HumanoidGetUp-v0")``.

Gymnasium calls :func:`register` by itself where the package is installed (its entry points); else
import this module, or ask for "sim2real.gym:HumanoidGetUp-v0".
"""

from __future__ import annotations

from gymnasium.envs import registration

NAME = "HumanoidGetUp-v0"


def register() -> None:
    """Make the environment known to Gymnasium; doing so twice is harmless."""
    if NAME not in registration.registry:
        registration.register(NAME, vector_entry_point="sim2real.make_env:make_get_up")


register()
