"""Backends: the robot that a job moves, simulated, behind a virtual bus, or real."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from drivers import Backend, GuardLimits, SafetyGuard, State, Twin
from drivers.dynamixel.backend import DriverOptions, DynamixelBackend
from drivers.dynamixel.clock import CycleClock
from drivers.twin.simulation import Simulation
from drivers.virtual_bus.served_robot import serve_robot
from drivers.virtual_bus.serving.server import TimeMode
from humanoid_getup.commands.inputs import name_ports
from humanoid_getup.commands.options import BackendOptions
from humanoid_getup.simulation.world import World
from robots import Posture, TorqueLimit

LEAST_LAG = 0.1  # s; less is no sign of a busy computer


@dataclass(frozen=True, kw_only=True)
class BackendChoice:
    """A robot to move, and access to its simulation."""

    backend: Backend
    realtime: bool
    """Whether cycles keep the deadlines of the wall clock."""
    simulation: Simulation | None = None
    """Ground truth behind a virtual bus; ``None`` for the twin and for a real robot."""
    place: Callable[[Posture], None] | None = None
    """Places a simulated robot in a posture."""
    warnings: tuple[str, ...] = ()
    """What its driver found that forbids no motion, to be shown before torque comes on."""
    findings: list[str] = field(default_factory=list)
    """What was found at the end, to be shown with the result."""


@contextmanager
def open_backend(
    request: BackendOptions, world: World, torque_limit: TorqueLimit, *, without_imu: bool = False
) -> Iterator[BackendChoice]:
    """Open the backend of a request, ready to connect; remove what was created at the end.

    A virtual bus of another process may be in lock-step: its driver counts periods then.
    ``without_imu`` is True for a robot that has none.
    """
    robot, realtime, limit_by = world.robot, request.is_realtime, torque_limit.mode
    if request.backend == "twin":
        twin = Twin(world, without_imu=without_imu)
        yield BackendChoice(backend=twin, realtime=realtime, place=twin.place)
        return
    if request.port:  # a robot, or a virtual bus of another process
        ports = name_ports(robot, request.port)
        driver = DynamixelBackend(robot, ports, limit_by=limit_by, without_imu=without_imu)
        with driver:  # a problem of the port or of servos is reported before anything is planned
            waits = driver.waits_for_commands()
            warnings = tuple(map(str, driver.diagnostics.warnings))
        if waits:
            driver = DynamixelBackend(
                robot, ports, clock=CycleClock(), limit_by=limit_by, without_imu=without_imu
            )
        realtime = request.realtime or not waits
        yield BackendChoice(backend=driver, realtime=realtime, warnings=warnings)
        return
    simulation = Simulation(world)
    time_mode = TimeMode.REAL_TIME if realtime else TimeMode.LOCK_STEP
    with serve_robot(simulation, time_mode=time_mode) as served:
        driver = DynamixelBackend(
            robot,
            served.paths,
            clock=None if realtime else CycleClock(),
            limit_by=limit_by,
            imu=served.imu,
            without_imu=without_imu,
            options=DriverOptions(make_port=served.make_port),
        )
        with driver:  # switches servo power on, as on a robot that was used before
            pass
        choice = BackendChoice(
            backend=driver, realtime=realtime, simulation=simulation, place=served.place
        )
        yield choice
        if served.behind > LEAST_LAG:
            choice.findings.append(
                f"the clock of the virtual robot fell {served.behind:.1f} s behind: this computer "
                "has too little time for its physics"
            )


class CancellableGuard(SafetyGuard):
    """A guard that checks in every cycle whether the work is canceled, and then measures."""

    def __init__(self, backend: Backend, limits: GuardLimits, check: Callable[[], None]) -> None:
        """Guard a backend; ``check`` raises `CancelledError` to end the work."""
        super().__init__(backend, limits)
        self._check = check

    def read(self) -> State:
        """Measure the robot."""
        self._check()
        return super().read()
