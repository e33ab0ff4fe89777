"""Kill `getup play` (SIGKILL) in the middle of a rise, and measure when the servos stop.

The client plays a motion from its own start, in real time; exit 1 if servos went on.

    python benchmarks/kill_client.py --n 20 --json kill.json
"""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
import tyro
from checked_driver import ServoTrace
from inject_faults import is_harmed, summarize_safe_times
from script import Options, write_results

from drivers.errors import DriverError
from drivers.twin.simulation import Simulation
from drivers.virtual_bus.served_robot import RealTimeRobot
from humanoid_getup.experiments.falls import find_rest
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import find_motion
from humanoid_getup.simulation.world import World

MAX_START_TIME = 30.0  # s until the client has switched torque on
KILL_WINDOW = (0.3, 0.8)  # part of the motion in which the client is killed
AFTERMATH = 0.6  # s observed after the kill
POLL = 0.01  # s between two checks for torque
FIGURES = ("n", "endings", "tripped", "safe_max_s", "never_safe", "beyond_limits")


@dataclass(frozen=True, kw_only=True)
class KillOptions(Options):
    """Options of this script."""

    n: int = 20
    """Kills."""
    motion: str = "supine_roll_over"
    """Name of a motion in the robot's database, or an .npz file."""


@dataclass(frozen=True, kw_only=True)
class KillTrial:
    """One client that was killed."""

    stop: float | None
    """Time from the kill until torque was off or the servos held [s]; None for never."""
    tripped: bool
    """Whether the bus watchdog of every servo had tripped."""
    beyond_limits: int


def main(options: KillOptions) -> dict[str, Any]:
    """Kill clients, one after another; write and return the figures."""
    world = options.load_world()
    motion = find_motion(world.robot, options.motion)
    rng, trials, refused = np.random.default_rng(options.seed), list[KillTrial](), 0
    while len(trials) < options.n:
        trial = kill_once(world, motion, float(rng.uniform(*KILL_WINDOW)))
        if trial is not None:
            trials.append(trial)
            continue
        refused += 1
        if refused > options.n:
            raise DriverError(
                f"the client did not switch its robot's torque on within {MAX_START_TIME:g} s, "
                f"{refused} times: expected a computer that has time for it"
            )
    case = {
        "n": options.n,
        "endings": {"killed": options.n, "never began": refused},
        "tripped": sum(trial.tripped for trial in trials),
        "beyond_limits": sum(trial.beyond_limits for trial in trials),
        **summarize_safe_times([trial.stop for trial in trials]),
    }
    cases = {"client killed (SIGKILL)": case}
    result = options.describe("kill", options.n) | {"motion": motion.name, "cases": cases}
    write_results(result, FIGURES, options.json)
    return result


def kill_once(world: World, motion: Motion, share: float) -> KillTrial | None:
    """Kill a client; None if it never started, as on an overloaded machine."""
    with RealTimeRobot(Simulation(world)) as served:
        served.place(find_rest(world, motion.posture(0)))
        trace = ServoTrace(served.physics)
        ports = ",".join(f"{name}={path}" for name, path in served.paths.items())
        command = [sys.executable, "-m", "humanoid_getup.commands.main", "play", motion.name]
        command += ["--robot", str(world.robot.folder)]
        command += ["--backend", "virtual", "--port", ports, "--then", "limp"]
        quiet = subprocess.DEVNULL
        with subprocess.Popen(command, stdin=quiet, stdout=quiet, stderr=quiet) as client:
            if not await_torque(served.simulation, client):
                return None
            time.sleep(motion.duration * share)
            killed = served.physics.time
            client.send_signal(signal.SIGKILL)
            time.sleep(AFTERMATH)
        tripped = all(value < 0 for value in served.peek("bus_watchdog"))
    return KillTrial(
        stop=trace.find_safe_time(killed),
        tripped=tripped,
        beyond_limits=trace.count_beyond_limits(),
    )


def await_torque(simulation: Simulation, client: subprocess.Popen[bytes]) -> bool:
    """Wait until a client switches torque on; kill it, and return False, if it does not."""
    until = time.monotonic() + MAX_START_TIME
    while not simulation.has_torque:
        if time.monotonic() > until or client.poll() is not None:
            client.kill()
            return False
        time.sleep(POLL)
    return True


if __name__ == "__main__":
    raise SystemExit(is_harmed(main(tyro.cli(KillOptions, description=__doc__))))
