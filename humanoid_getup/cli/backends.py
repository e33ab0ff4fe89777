"""The robot that a command moves: simulated, behind a virtual bus, or real."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from drivers import Backend, Twin
from drivers.dynamixel.backend import DynamixelBackend, Release
from drivers.dynamixel.clock import CycleClock
from drivers.twin.simulation import Simulation
from drivers.virtual_bus.serving.server import TimeMode
from drivers.virtual_bus.virtual_robot import VirtualPorts, VirtualRobot
from humanoid_getup.cli.ports import name_ports
from humanoid_getup.execution.recovery import RebootsServos
from humanoid_getup.simulation.world import World
from robots import Posture, TorqueLimit

TWIN, VIRTUAL, DYNAMIXEL = "twin", "virtual", "dynamixel"
RELEASES = {"limp": Release.LIMP, "hold": Release.HOLD}
LOCK_STEP_MARGIN = 0.2  # s to wait for an answer: nothing is timed, and the machine may be busy


@dataclass(frozen=True, kw_only=True)
class BackendChoice:
    """A robot to move, and what else can be done with it."""

    backend: Backend
    realtime: bool
    """True when cycles keep the deadlines of the wall clock."""
    simulation: Simulation | None = None
    """What judges may look into; None for a robot that is only what it measures."""
    place: Callable[[Posture], None] | None = None
    """Puts a simulated robot somewhere."""
    services: RebootsServos | None = None

    def limit_torque(self, value: float | None) -> TorqueLimit:
        """Make a torque limit [N·m] that acts as this robot's: by PWM, or ideal on the twin."""
        return TorqueLimit(value, "torque" if self.services is None else "pwm")

    @property
    def is_real(self) -> bool:
        """Tell whether it may be a real robot: then it lies where it lies."""
        return self.simulation is None


@contextmanager
def open_body(
    world: World,
    backend: str,
    *,
    ports: Sequence[str] = (),
    realtime: bool = False,
    release: str = "limp",
    seed: int = 0,
) -> Iterator[BackendChoice]:
    """Open a backend, not yet connected; remove at the end what was created.

    Args:
        world: Robot and scene.
        backend: twin, virtual or dynamixel; a virtual one with ports is a bus that runs elsewhere.
        ports: Serial ports: a path, or NAME=PATH for each of several.
        realtime: Let a simulated robot live at the speed of life.
        release: What is left when the robot's bus is closed, one of `RELEASES`.
        seed: Seed of a virtual bus' chance.
    """
    robot = world.robot
    if backend == TWIN:
        twin = Twin(world)
        yield BackendChoice(
            backend=twin, realtime=realtime, simulation=twin.simulation, place=twin.place
        )
        return
    if ports:
        named = name_ports(robot, ports)
        driver = DynamixelBackend(robot, named, release=RELEASES[release])
        with driver:  # what is wrong with port or servos is told before anything is planned
            pass
        yield BackendChoice(backend=driver, realtime=True, services=driver)
        return
    virtual = VirtualRobot(Simulation(world))
    time_mode = TimeMode.REAL_TIME if realtime else TimeMode.LOCK_STEP
    with VirtualPorts(virtual, time_mode=time_mode, rng=np.random.default_rng(seed)) as served:
        driver = DynamixelBackend(robot, served.paths, release=RELEASES[release])
        if not realtime:
            driver = DynamixelBackend(
                robot,
                served.paths,
                clock=CycleClock(),
                answer_margin=LOCK_STEP_MARGIN,
                release=RELEASES[release],
            )
        with driver:  # switches the servos' power on, as on a robot that was used before
            pass
        yield BackendChoice(
            backend=driver,
            realtime=realtime,
            simulation=virtual.simulation,
            place=lambda posture: served.main.call(lambda: virtual.place(posture)),
            services=driver,
        )
