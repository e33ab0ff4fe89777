"""The process of the robot: its control loop is not disturbed by what LeRobot's process does.

When LeRobot's process ends, however it ends, torque goes off. When this one is killed, servos with
a bus watchdog stop by themselves; others hold until their power is switched off.
"""

from __future__ import annotations

import contextlib
import sys
import threading
import traceback
from multiprocessing.connection import Connection

import numpy as np

from drivers import DriverError, GuardLimits
from getup_server.end_watch import EndWatch
from getup_server.mailbox import Mailbox
from getup_server.messages import Act, Refusal, Setup, Snapshot
from getup_server.robot_request import RobotRequest
from getup_server.robot_runner import RobotRunner, RobotStoppedError
from getup_server.shared_guard import SharedGuard
from humanoid_getup.experiments.starts.falls import find_rest
from humanoid_getup.jobs.backends import open_backend
from humanoid_getup.jobs.errors import BadInputError, refusing
from humanoid_getup.jobs.inputs import find_start, load_world, make_torque_limit
from humanoid_getup.jobs.plan_cache import open_plan_cache
from humanoid_getup.progress.callback import CancelledError, ProgressMonitor
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.cache.cached_rise import CachedRise
from humanoid_getup.strategies.choice import StrategyRequest, choose_strategy
from humanoid_getup.strategies.plan import Strategy
from robots import Posture, TorqueLimit

ENDED = "it was asked to end"


def main(descriptor: int) -> int:
    """Run the robot that the parent describes; end with it. Return 0 if torque is surely off.

    ``descriptor`` is that of the connection to the parent.
    """
    connection, watch = Connection(descriptor), EndWatch()
    try:
        setup = connection.recv()
    except (EOFError, OSError):
        return 0
    try:
        run_robot(setup, connection, watch)
    except CancelledError:
        return 0  # asked to end while it was opened
    except Exception as error:
        with contextlib.suppress(OSError):  # the parent is gone
            connection.send(Refusal(_describe(error)))
        return 1
    return 0


def run_robot(setup: Setup, connection: Connection, watch: EndWatch) -> None:
    """Open a robot and run it until the connection closes, or the watch sees another end.

    Raises:
        BadInputError: if the request cannot be done.
        DriverError: if the robot cannot be reached.
        RobotStoppedError: if it cannot be measured.
    """
    request = setup.request
    world = load_world(request)
    limit = make_torque_limit(request, world.robot)
    nothing = np.zeros(world.robot.n)
    mailbox = Mailbox(
        Snapshot(joint_pos=nothing, targets=nothing, gravity_b=np.zeros(0), gyro_b=np.zeros(0))
    )
    watch.start(mailbox.stop)
    strategy = _choose_strategy(setup, world, limit, mailbox) if setup.rises else None
    start = _choose_start(request, world)
    without_imu = world.robot.imu_kind is None
    with open_backend(request, world, limit, without_imu=without_imu) as choice:
        guard = SharedGuard(
            choice.backend, GuardLimits.of(world.robot, limit.value), mailbox, world
        )
        runner = RobotRunner(choice, guard, mailbox, setup, world, strategy, start)
        answering = threading.Thread(target=answer, args=(connection, mailbox), daemon=True)
        try:
            runner.run(answering.start)
            mailbox.end(ENDED)
        except Exception as error:
            if answering.ident is None or isinstance(error, CancelledError):
                raise
            mailbox.end(_describe(error))
            mailbox.wait_for_end()  # LeRobot learns why when it sends something next
            if choice.backend.unreleased:
                raise


def _describe(error: Exception) -> str:
    """Say why the robot stopped, in one line; an unexpected error leaves its trace on stderr."""
    if isinstance(error, (BadInputError, DriverError, RobotStoppedError)):
        return str(error)
    traceback.print_exception(error)
    return f"unexpected {type(error).__name__}: {' '.join(str(error).split())}"


def answer(connection: Connection, mailbox: Mailbox) -> None:
    """Answer the messages of LeRobot's process until it closes the connection."""
    try:
        connection.send(mailbox.observe())
        while True:
            message = connection.recv()
            is_action = isinstance(message, Act)
            connection.send(mailbox.post(message.targets) if is_action else mailbox.observe())
    except (EOFError, OSError):
        pass
    finally:
        mailbox.stop()


def _choose_strategy(setup: Setup, world: World, limit: TorqueLimit, mailbox: Mailbox) -> Strategy:
    """Load what gets the robot up; a motion is planned, or taken from the user's plan cache."""
    request = setup.request
    wanted = StrategyRequest(method=request.method, torque_limit=limit, policy=request.policy)
    monitor = ProgressMonitor(cancel=mailbox.is_stopping)
    with refusing():
        return choose_strategy(
            world, wanted, lambda planner: CachedRise(planner, open_plan_cache()), monitor
        )


def _choose_start(request: RobotRequest, world: World) -> Posture | None:
    """Find where a simulated robot begins; None for a real one, which begins as it is."""
    if request.is_real:
        return None
    if request.origin is None:
        return find_rest(world, world.robot.standing)
    return find_start(world, request.origin, np.random.default_rng(request.seed)).posture


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1])))
