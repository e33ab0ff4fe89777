"""Domain parameters: differences between simulated robots besides their starts."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.simulation.world import World
from robots.quaternion import Array
from robots.servo import LIMIT_MODES, LimitMode


@dataclass(frozen=True, kw_only=True, eq=False)
class DomainParameters:
    """Body, servos, sensors and ground of each of N robots.

    :class:`VecSim` applies what acts in physics. Delays, encoder offsets, backlash and IMU
    errors act in :class:`sim2real.environment.training_simulation.TrainingSim` alone.
    """

    mass: Array
    """Scale of each link's mass and inertia, (N, bodies)."""
    com_shift: Array
    """Shift of the torso's center of mass [m], (N, 3)."""
    friction: Array
    """Sliding friction of every contact, (N,)."""
    voltage: Array
    """Supply [V], (N,)."""
    torque_limit: Array
    """Torque limit of every servo [N·m], (N,)."""
    limit_by: NDArray[np.int_]
    """What the torque limit acts on, as an index into ``LIMIT_MODES``, (N,)."""
    strength: Array
    """Scale of each servo's torque and gain, (N, n)."""
    armature: Array
    """Scale of the rotors' inertia, (N,)."""
    friction_loss: Array
    """Scale of the servos' dry friction, (N,)."""
    action_delay: Array
    """Age of targets when they reach the servos [s], (N,)."""
    sensor_delay: Array
    """Age of measurements when they are used [s], (N,)."""
    joint_offset: Array
    """Error of the encoders: measured minus true angle [rad], (N, n)."""
    backlash: Array
    """Backlash of each gear, from end to end [rad], (N,)."""
    imu_tilt: Array
    """Mounting error of the IMU, a small rotation vector [rad], (N, 3)."""
    gyro_bias: Array
    """[rad/s], (N, 3)"""

    @property
    def n(self) -> int:
        """Return the number of robots."""
        return len(self.friction)

    @staticmethod
    def nominal(
        world: World,
        n: int,
        *,
        torque_limit: Array | float | None = None,
        limit_by: LimitMode | None = None,
    ) -> DomainParameters:
        """Make the nominal parameters of ``n`` robots.

        A torque limit [N·m], (N,) or a number, overrides that of the servos; by default it acts in
        the robot's own mode.
        """
        robot = world.robot
        limit = float(robot.max_torque.max()) if torque_limit is None else torque_limit
        return DomainParameters(
            mass=np.ones((n, world.model.nbody)),
            com_shift=np.zeros((n, 3)),
            friction=np.full(n, world.scene.surface.friction),
            voltage=np.full(n, robot.supply_voltage),
            torque_limit=np.full(n, limit),
            limit_by=np.full(n, LIMIT_MODES.index(limit_by or robot.limit_by)),
            strength=np.ones((n, robot.n)),
            armature=np.ones(n),
            friction_loss=np.ones(n),
            action_delay=np.full(n, robot.individual.delay),
            sensor_delay=np.zeros(n),
            joint_offset=np.zeros((n, robot.n)),
            backlash=np.zeros(n),
            imu_tilt=np.zeros((n, 3)),
            gyro_bias=np.zeros((n, 3)),
        )

    def put(self, ids: NDArray[np.int_], others: DomainParameters) -> None:
        """Overwrite the parameters of some robots, in place."""
        for field in fields(self):
            getattr(self, field.name)[ids] = getattr(others, field.name)

    def take(self, rows: NDArray[np.int_]) -> DomainParameters:
        """Return the parameters of some robots."""
        return DomainParameters(
            **{field.name: getattr(self, field.name)[rows] for field in fields(self)}
        )

    def tile(self, times: int) -> DomainParameters:
        """Repeat all robots a number of times."""
        return DomainParameters(
            **{
                field.name: np.concatenate([getattr(self, field.name)] * times)
                for field in fields(self)
            }
        )
