"""Job that checks the robot of a running program by its live feed."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import msgspec
import numpy as np

from drivers.live_feed.feed import find_feed, list_feeds
from drivers.live_feed.follower import LiveFollower
from drivers.live_feed.messages import FeedError, LiveHello, LiveSample
from drivers.safety_limits import GuardLimits
from drivers.state import HardwareError
from humanoid_getup.jobs.errors import BadInputError
from humanoid_getup.jobs.requests.health import HealthRequest

SLOW = 0.9  # share of the wanted rate below which the computer is late
STALE_IMU = GuardLimits.max_imu_age / 3.0  # s; at the whole the guard releases a robot
FIRST_SAMPLE = 5.0  # s within which a program has measured once


class RobotHealth(msgspec.Struct, frozen=True, kw_only=True):
    """What a running program measures of its robot."""

    robot: str
    program: int
    """Number of its process."""
    phase: str
    healthy: bool
    findings: list[str]
    rate_hz: float
    """Control cycles a second; 0 while it computes and none passes."""
    wanted_hz: float
    read_age_s: float
    """Age of the oldest joint's values at the last cycle."""
    imu_age_s: float | None
    """Age of the orientation; None without an IMU."""
    torque_on: bool
    torque_limits_nm: dict[str, float]
    """Torque limits in force, behind the gears."""
    voltage_v: float
    hottest: str
    """Joint of the hottest servo."""
    hottest_c: float
    clips: int
    """Number of commands that the guard has cut."""


def check_health(request: HealthRequest) -> RobotHealth:
    """Follow a running program for a time, and report what it measures.

    Raises:
        BadInputError: if no program shows a robot, or several do and none is named.
        FeedError: if its feed cannot be followed, or it ended.
    """
    HealthRequest.accept(request)
    path = _find_feed(request.program)
    first, last, begun = threading.Event(), list[LiveSample](), list[tuple[float, LiveSample]]()

    def note(sample: LiveSample) -> None:
        if not begun:
            begun.append((time.monotonic(), sample))
        last[:] = [sample]
        first.set()

    follower = LiveFollower(path, note)
    try:
        if not first.wait(FIRST_SAMPLE):
            raise FeedError(
                f"live feed {path.name}: nothing measured within {FIRST_SAMPLE:g} s, it may be "
                "planning"
            )
        time.sleep(request.seconds)
        (since, oldest), newest = begun[0], last[0]
        passed = time.monotonic() - since
    finally:
        follower.close()
    rate = (newest.cycle - oldest.cycle) / passed
    return describe_health(follower.hello, newest, rate, int(path.stem.rpartition("-")[2]))


def _find_feed(program: int | None) -> Path:
    """Find the feed of a program, or the only one."""
    if program is not None:
        found = find_feed(program)
        if found is None:
            raise BadInputError(f"program {program} shows no robot: start it with --live")
        return found
    feeds = list_feeds()
    if not feeds:
        raise BadInputError("no program shows a robot: start rise, watch or another with --live")
    if len(feeds) > 1:
        names = ", ".join(feed.stem for feed in feeds)
        raise BadInputError(f"several programs show a robot ({names}), expected --program PID")
    return feeds[0]


def describe_health(hello: LiveHello, sample: LiveSample, rate: float, program: int) -> RobotHealth:
    """Describe a sample of a robot whose cycles have a rate [Hz]."""
    names, findings = hello.joint_names, _find_problems(hello, sample, rate)
    hottest = int(np.argmax(sample.temperature))
    return RobotHealth(
        robot=hello.robot,
        program=program,
        phase=sample.phase,
        healthy=not findings,
        findings=findings,
        rate_hz=rate,
        wanted_hz=1.0 / hello.period,
        read_age_s=max(sample.joint_age),
        imu_age_s=sample.imu_age if sample.orientation else None,
        torque_on=not sample.is_limp,
        torque_limits_nm=dict(zip(names, sample.torque_limit, strict=True)),
        voltage_v=sample.voltage,
        hottest=names[hottest],
        hottest_c=sample.temperature[hottest],
        clips=sample.clips,
    )


def _find_problems(hello: LiveHello, sample: LiveSample, rate: float) -> list[str]:
    """List what is wrong, one sentence for each cause."""
    names, problems = hello.joint_names, list[str]()
    wanted = 1.0 / hello.period
    if 0.0 < rate < SLOW * wanted:
        problems.append(
            f"{rate:.0f} cycles a second, expected {wanted:.0f}: this computer is too busy"
        )
    old = [n for n, age in zip(names, sample.joint_age, strict=True) if _is_old(age, hello)]
    if len(old) == len(names):
        problems.append(f"all servos have been silent for {max(sample.joint_age):.2f} s: no power?")
    elif old:
        problems.append(f"silent for {max(sample.joint_age):.2f} s: {', '.join(old)}")
    if sample.orientation and sample.imu_age > STALE_IMU:
        problems.append(f"the IMU has been silent for {sample.imu_age:.2f} s")
    if sample.voltage < hello.min_voltage:
        problems.append(
            f"the supply is {sample.voltage:.1f} V, expected {hello.min_voltage:.1f} V or more"
        )
    for name, temperature, most in zip(
        names, sample.temperature, hello.max_temperature, strict=True
    ):
        if temperature > most:
            problems.append(f"{name} is {temperature:.0f} °C hot, expected at most {most:.0f} °C")
    for name, bits in zip(names, sample.alert, strict=True):
        if error := HardwareError(bits):
            problems.append(f"{name} reports {error.describe()}")
    return problems


def _is_old(age: float, hello: LiveHello) -> bool:
    return age >= GuardLimits.hold_cycles * hello.period  # from which targets are held
