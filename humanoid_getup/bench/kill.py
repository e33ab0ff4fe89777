"""The killed client: how long servos go on when the program behind them is gone at once."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from drivers.simulation import Simulation
from drivers.virtual.robot import VirtualPorts, VirtualRobot
from drivers.virtual.server import Pace
from humanoid_getup.bench.statistics import summarise
from humanoid_getup.bench.witness import Sights
from humanoid_getup.build import settle_posture
from humanoid_getup.lying import read_posture
from humanoid_getup.motion import Motion
from humanoid_getup.stage import Stage

LONGEST_START = 30.0  # s until the client has its robot under torque
WINDOW = (0.3, 0.8)  # share of the motion in which the client is killed
AFTERMATH = 0.6  # s watched after the kill
LOOK = 0.01  # s between two looks for torque


def bench_kill(
    stage: Stage,
    motion: Motion,
    *,
    seed: int,
    each: int,
    report: Callable[[dict[str, Any]], None] = lambda _: None,
) -> dict[str, Any]:
    """Kill a client (SIGKILL) in the middle of a rise on a real-time bus; time the stop.

    Args:
        stage: Robot and scene.
        motion: Rise that the client plays, from its own start.
        seed: Seed of the moments.
        each: Kills.
        report: Told after each.
    """
    rng = np.random.default_rng(seed)
    trials: list[dict[str, Any]] = []
    refused = 0
    while len(trials) < each:
        trial = _kill_once(stage, motion, float(rng.uniform(*WINDOW)))
        if trial is not None:
            trials.append(trial)
            report(trial)
            continue
        refused += 1
        if refused > each:
            raise RuntimeError("the client does not bring its robot under torque")
    stops = [trial["stop_s"] for trial in trials]
    case = {
        "n": each,
        "stood": 0,
        "endings": {"killed": each, "never began": refused},
        "tripped": sum(bool(trial["tripped"]) for trial in trials),
        "safe_s": summarise(stops),
        "safe_max_s": max((s for s in stops if s is not None), default=None),
        "never_safe": sum(stop is None for stop in stops),
        "beyond_limits": sum(int(trial["beyond_limits"]) for trial in trials),
        "believed_wrong": 0,
    }
    name = "client killed (SIGKILL)"
    return {"name": "kill", "seed": seed, "n": each, "cases": {name: case}}


def _kill_once(stage: Stage, motion: Motion, share: float) -> dict[str, Any] | None:
    """Kill a client; ``None`` when it never began, on a machine too busy for it."""
    robot = stage.robot
    virtual = VirtualRobot(Simulation(robot, stage.model))
    virtual.place(read_posture(robot, stage.model, settle_posture(stage, motion.posture(0))))
    sights = Sights(virtual)
    with VirtualPorts(virtual, pace=Pace.REAL_TIME) as ports:
        command = [sys.executable, "-m", "humanoid_getup.cli", "play", motion.name]
        command += ["--robot", str(robot.folder)]
        command += ["--backend", "virtual", "--port", ports.main.path]
        with subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, stdin=subprocess.DEVNULL
        ) as client:
            if not _await_torque(virtual, client):
                return None
            time.sleep(motion.duration * share)
            killed = ports.main.call(lambda: _kill(client, virtual))
            time.sleep(AFTERMATH)
        tripped = ports.main.call(
            lambda: all(servo.peek("bus_watchdog") < 0 for servo in virtual.servos)
        )
    return {
        "stop_s": sights.find_safe_time(killed),
        "tripped": tripped,
        "beyond_limits": sights.count_beyond_limits(),
    }


def _await_torque(virtual: VirtualRobot, client: subprocess.Popen[bytes]) -> bool:
    until = time.monotonic() + LONGEST_START
    while not virtual.simulation.has_torque:
        if time.monotonic() > until or client.poll() is not None:
            client.kill()
            return False
        time.sleep(LOOK)
    return True


def _kill(client: subprocess.Popen[bytes], virtual: VirtualRobot) -> float:
    client.send_signal(signal.SIGKILL)
    return virtual.body.time
