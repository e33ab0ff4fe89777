"""Rises and a pose prior that are made up, small enough to train with in seconds."""

import numpy as np

from robots import Robot
from sim2real.pose_prior import CollectedRise, Network, PosePrior, RiseSet

RIGHT = np.pi / 2


def make_rises(robot: Robot, count: int = 6) -> RiseSet:
    """Make rises that move two joints of the left side from lying to standing."""
    model = robot.spec().compile()
    layout, rises = robot.layout(model), []
    for number in range(count):
        frames = 20 + number
        share = np.linspace(0.0, 1.0, frames)
        qpos = np.tile(model.qpos0, (frames, 1))
        height = 0.05 + share * (robot.standing.position[2] - 0.05)
        angle = -0.5 * np.pi * (1.0 - share)  # from the back to upright
        qpos[:, layout.root_position] = np.stack([0 * share, 0 * share, height], axis=-1)
        qpos[:, layout.root_orientation] = np.stack(
            [np.cos(angle / 2), 0 * angle, np.sin(angle / 2), 0 * angle], axis=-1
        )
        joint_pos = np.tile(robot.standing.joint_pos, (frames, 1))
        joint_pos[:, robot.joint_names.index("l_knee")] += 0.8 * (1.0 - share)
        joint_pos[:, robot.joint_names.index("l_el")] += 0.1 * number * np.sin(6.0 * share)
        qpos[:, layout.qpos] = joint_pos
        source = "planned: made up" if number % 2 else "policy: made up"
        rises.append(CollectedRise(source=source, qpos=qpos, joint_target=joint_pos + 0.01))
    return RiseSet.join(robot, rises)


def make_prior(robot: Robot, latents: int = 3) -> PosePrior:
    """Make a prior of random weights whose first latent alone is antisymmetric."""
    rng = np.random.default_rng(0)

    def layers(*sizes: int) -> Network:
        pairs = list(zip(sizes[1:], sizes[:-1], strict=True))
        weights = tuple(rng.normal(0.0, b**-0.5, (a, b)).astype(np.float32) for a, b in pairs)
        return Network(weights, tuple(np.zeros(a, dtype=np.float32) for a, _ in pairs))

    return PosePrior(
        robot=robot,
        latent_sign=np.array([-1.0, *[1.0] * (latents - 1)]),
        latent_mean=np.zeros(latents),
        latent_std=np.full(latents, 0.5),
        pos_mean=robot.standing.joint_pos,
        pos_std=np.full(robot.n, 0.3),
        feature_mean=np.array([0.6, RIGHT, RIGHT]),
        feature_std=np.array([0.3, 0.5, 0.5]),
        encoder=layers(robot.n + 3, 16, 16, 2 * latents),
        decoder=layers(latents + 3, 16, 16, robot.n),
    )
