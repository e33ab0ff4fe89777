"""Registers the environment with Gymnasium: ``gymnasium.make_vec("HumanoidGetUp-v0")``.

Gymnasium finds it by the entry point in pyproject.toml. If the package is not installed,
import this module, or make "sim2real.environment.registration:HumanoidGetUp-v0".
"""

from gymnasium.envs import registration

NAME = "HumanoidGetUp-v0"
ENTRY_POINT = "sim2real.environment.get_up_factory:make_get_up"


def register() -> None:
    """Register the environment; calling this twice is harmless."""
    if NAME not in registration.registry:
        registration.register(NAME, vector_entry_point=ENTRY_POINT)


register()
