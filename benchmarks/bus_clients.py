"""Foreign clients, unmodified, at `getup bus`: what fails and how long it takes, idle and busy.

    pip install dynamixel-sdk rustypot dynamixel-python feetech-servo-sdk
    pip install --no-deps lerobot deepdiff orderly-set tqdm cachebox
    python benchmarks/bus_clients.py --repeats 500 --json bus_clients.json

An OP3 lies on a virtual bus in real time; Feetech's clients have 20 STS3215 on a bench. One after
another, each client pings a servo, reads one register of it, writes one, reads the positions of all
servos and writes all goals, many times; a client that can scan scans once. All is done twice: on an
idle computer, and beside one busy process a core. An operation that fails is not repeated.
`--rises N` gets the robot up N times over the port beside the busy processes, too.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from json import dumps
from pathlib import Path
from typing import Any

import numpy as np
import serial
import tyro
from bus_cycle import busy_processes, open_lerobot

from drivers.dynamixel import protocol2
from robots import load_robot

GETUP = (sys.executable, "-m", "humanoid_getup.commands.main")
ROBOT = load_robot("op3")
IDS = [joint.servo.id for joint in ROBOT.joints]
FIRST, BOARD = IDS[0], 200
BAUD = ROBOT.bus.baud if ROBOT.bus else 0  # bit/s
LED, GOAL, POSITION = 65, 116, 132
MIDDLE = 2048  # ticks
FEETECH_BAUD, FEETECH_TORQUE = 1_000_000, 40  # bit/s, register
FEETECH_GOAL, FEETECH_POSITION = 42, 56
OP3 = ("--robot", "op3", "--powered")
FEETECH = ("--servos", f"STS3215-C018:{','.join(map(str, IDS))}")
SETTLING, RESTING = 3.0, 10.0  # s until the robot rests, and in which its bus is measured
PAUSE = 0.002  # s between two operations, in which the bus may do something else

Operations = Mapping[str, Callable[[], object]]
"""Operations by name; one that fails raises an exception, or returns False."""


@contextmanager
def bus_process(*options: str) -> Iterator[subprocess.Popen[str]]:
    """Run `getup bus`."""
    command = [*GETUP, "bus", *options]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as process:
        yield process
        process.terminate()


@contextmanager
def bus(*options: str) -> Iterator[str]:
    """Serve a virtual robot in another process; yield its path."""
    with bus_process(*options) as process:
        yield read_path(process)


def read_path(process: subprocess.Popen[str]) -> str:
    """Wait for a bus; return its path."""
    return process.stdout.readline().strip() if process.stdout else ""


@contextmanager
def bare_bytes(path: str) -> Iterator[Operations]:
    """Send frames, and wait for all bytes of the replies."""
    with serial.Serial(path, BAUD, timeout=0.1) as port:

        def exchange(frame: bytes, size: int) -> bool:
            port.reset_input_buffer()
            port.write(frame)
            return len(port.read(size)) == size

        one, all_ = protocol2.Span(POSITION, 4), len(IDS) * 15
        goals = protocol2.sync_write(
            GOAL, dict.fromkeys(IDS, MIDDLE.to_bytes(4, "little"))
        ).encode()
        yield {
            "ping": lambda: exchange(protocol2.ping(FIRST).encode(), 14),
            "read": lambda: exchange(protocol2.read(FIRST, one).encode(), 15),
            "write": lambda: exchange(protocol2.write(FIRST, LED, b"\x01").encode(), 11),
            "group read": lambda: exchange(protocol2.sync_read(IDS, one).encode(), all_),
            "group write": lambda: port.write(goals),
        }


@contextmanager
def dynamixel_sdk(path: str) -> Iterator[Operations]:
    """Use ROBOTIS' SDK."""
    import dynamixel_sdk as sdk

    port, packets = sdk.PortHandler(path), sdk.PacketHandler(2.0)
    assert port.openPort()
    assert port.setBaudRate(BAUD)
    reader = sdk.GroupSyncRead(port, packets, POSITION, 4)
    writer = sdk.GroupSyncWrite(port, packets, GOAL, 4)
    for servo in IDS:
        reader.addParam(servo)
        writer.addParam(servo, MIDDLE.to_bytes(4, "little"))
    good = sdk.COMM_SUCCESS
    yield {
        "ping": lambda: packets.ping(port, FIRST)[1] == good,
        "read": lambda: packets.read4ByteTxRx(port, FIRST, POSITION)[1] == good,
        "write": lambda: packets.write1ByteTxRx(port, FIRST, LED, 1)[0] == good,
        "group read": lambda: reader.txRxPacket() == good,
        "group write": lambda: writer.txPacket() == good,
        "scan": lambda: set(IDS) <= set(packets.broadcastPing(port)[0] or ()),
    }
    port.closePort()


@contextmanager
def rustypot(path: str) -> Iterator[Operations]:
    """Use Pollen Robotics' client."""
    import rustypot as peer  # pyright: ignore[reportMissingImports]

    port = peer.Xl430PyController(path, BAUD, 0.1)
    yield {
        "ping": lambda: port.ping(FIRST),
        "read": lambda: port.read_present_position(FIRST),
        "write": lambda: port.write_led(FIRST, 1),
        "group read": lambda: port.sync_read_present_position(IDS),
        "group write": lambda: port.sync_write_goal_position(IDS, [MIDDLE] * len(IDS)),
        "scan": lambda: set(IDS) <= set(port.scan()),
    }
    port.close()


@contextmanager
def dynamixel_python(path: str) -> Iterator[Operations]:
    """Use dynamixel-python (package dxl2)."""
    from dxl2 import v2  # pyright: ignore[reportMissingImports]

    port = v2.MotorBus(path, BAUD)
    port.connect()
    group = v2.SyncParams(POSITION, 4, signed=True)
    goals = v2.SyncParams(GOAL, 4, signed=True)
    for servo in IDS:
        group.add_motor(servo)
        goals.add_value(servo, MIDDLE)
    yield {
        "ping": lambda: port.ping(FIRST).ok,
        "read": lambda: port.read(FIRST, POSITION, 4).ok,
        "write": lambda: port.write(FIRST, LED, 1, 1).ok,
        "group read": lambda: port.sync_read(group).ok,
        "group write": lambda: port.sync_write(goals),
        "scan": lambda: set(IDS) <= set(port.broadcast_ping().data or ()),
    }
    port.disconnect()


@contextmanager
def lerobot(path: str) -> Iterator[Operations]:
    """Use LeRobot's Dynamixel bus."""
    port = open_lerobot(path, ROBOT)
    first = ROBOT.joint_names[0]
    goals: dict[str, Any] = dict.fromkeys(ROBOT.joint_names, MIDDLE)
    yield {
        "ping": lambda: port.ping(first) is not None,
        "read": lambda: port.read("Present_Position", first, normalize=False),
        "write": lambda: port.write("LED", first, 1, normalize=False),
        "group read": lambda: port.sync_read("Present_Position", normalize=False),
        "group write": lambda: port.sync_write("Goal_Position", goals, normalize=False),
        "scan": lambda: set(IDS) <= set(port.broadcast_ping() or ()),
    }
    port.disconnect(disable_torque=False)


@contextmanager
def easy_sdk(path: str) -> Iterator[Operations]:
    """Use the classes of servos that ROBOTIS' SDK brings since version 4."""
    import dynamixel_easy_sdk as sdk

    port = sdk.Connector(path, BAUD)
    motors = [port.createMotor(servo) for servo in IDS]
    for motor in motors:  # it sends no goal to a servo with torque off
        motor.enableTorque()
    reader, writer = port.createGroupExecutor(), port.createGroupExecutor()
    for motor in motors:
        reader.addCmd(motor.stageGetPresentPosition())
        writer.addCmd(motor.stageSetGoalPosition(motor.getPresentPosition()))
    first = motors[0]
    yield {
        "ping": first.ping,
        "read": first.getPresentPosition,
        "write": first.LEDOn,
        "group read": lambda: None not in reader.executeRead(),
        "group write": writer.executeWrite,
        "scan": lambda: set(IDS) <= set(port.broadcastPing()),
    }
    port.closePort()


@contextmanager
def scservo_sdk(path: str) -> Iterator[Operations]:
    """Use Feetech's SDK."""
    import scservo_sdk as sdk  # pyright: ignore[reportMissingImports]

    port, packets = sdk.PortHandler(path), sdk.PacketHandler(0)
    assert port.openPort()
    assert port.setBaudRate(FEETECH_BAUD)
    reader = sdk.GroupSyncRead(port, packets, FEETECH_POSITION, 2)
    writer = sdk.GroupSyncWrite(port, packets, FEETECH_GOAL, 2)
    for servo in IDS:
        reader.addParam(servo)
        writer.addParam(servo, MIDDLE.to_bytes(2, "little"))
    good = sdk.COMM_SUCCESS
    yield {
        "ping": lambda: packets.ping(port, FIRST)[1] == good,
        "read": lambda: packets.read2ByteTxRx(port, FIRST, FEETECH_POSITION)[1] == good,
        "write": lambda: packets.write1ByteTxRx(port, FIRST, FEETECH_TORQUE, 0)[0] == good,
        "group read": lambda: reader.txRxPacket() == good,
        "group write": lambda: writer.txPacket() == good,
    }
    port.closePort()


@contextmanager
def rustypot_feetech(path: str) -> Iterator[Operations]:
    """Use Pollen Robotics' client with servos of Feetech."""
    import rustypot as peer  # pyright: ignore[reportMissingImports]

    port = peer.Sts3215PyController(path, FEETECH_BAUD, 0.1)
    yield {
        "ping": lambda: port.ping(FIRST),
        "read": lambda: port.read_present_position(FIRST),
        "write": lambda: port.write_torque_enable(FIRST, False),
        "group read": lambda: port.sync_read_present_position(IDS),
        "group write": lambda: port.sync_write_goal_position(IDS, [0.0] * len(IDS)),
    }
    port.close()


@dataclass(frozen=True)
class Client:
    """A program for servos, and the bus that it is for."""

    connect: Callable[[str], AbstractContextManager[Operations]]
    bus: tuple[str, ...] = OP3
    """Options of `getup bus`."""


CLIENTS = {
    "bare bytes": Client(bare_bytes),
    "dynamixel-sdk": Client(dynamixel_sdk),
    "dynamixel-easy-sdk": Client(easy_sdk),
    "rustypot": Client(rustypot),
    "dynamixel-python": Client(dynamixel_python),
    "lerobot": Client(lerobot),
    "scservo_sdk, STS3215": Client(scservo_sdk, FEETECH),
    "rustypot, STS3215": Client(rustypot_feetech, FEETECH),
}


def measure(operation: Callable[[], object], repeats: int) -> dict[str, float]:
    """Repeat an operation; return how often it failed, and its times [ms]."""
    times, failures = np.zeros(repeats), 0
    for k in range(repeats):
        begun = time.perf_counter()
        try:
            failures += operation() is False
        except Exception as error:  # whatever a foreign client raises
            if not failures:
                print(f"  {type(error).__name__}: {str(error)[:100]}", file=sys.stderr)
            failures += 1
        times[k] = time.perf_counter() - begun
        time.sleep(PAUSE)
    median, p99, longest = 1e3 * np.percentile(times, (50, 99, 100))
    return {
        "n": repeats,
        "failed": failures,
        "median_ms": float(median),
        "p99_ms": float(p99),
        "max_ms": float(longest),
    }


def measure_client(name: str, path: str, repeats: int) -> dict[str, dict[str, float]]:
    """Measure all operations of a client; scans once in a hundred."""
    cases = dict[str, dict[str, float]]()
    with CLIENTS[name].connect(path) as operations:
        for operation, work in operations.items():
            count = max(repeats // 100, 1) if operation == "scan" else repeats
            cases[operation] = measure(work, count)
            figures = ", ".join(f"{key} {value:.4g}" for key, value in cases[operation].items())
            print(f"  {operation:12} {figures}", flush=True)
    return cases


def measure_rest() -> dict[str, float]:
    """Measure which share of a core a bus takes whose limp robot lies still."""
    with bus_process(*OP3) as process:
        read_path(process)
        time.sleep(SETTLING)
        before = count_processor_time(process.pid)
        time.sleep(RESTING)
        return {"core_share": (count_processor_time(process.pid) - before) / RESTING}


def count_processor_time(parent: int) -> float:
    """Count the processor time of a process and its children so far [s]."""
    found = 0.0
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):  # it ended meanwhile
            fields = stat.read_text().rpartition(")")[2].split()
            if parent in (int(stat.parent.name), int(fields[1])):
                found += (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    return found


def count_rises(count: int) -> int:
    """Play a rise over the port some times; return how often the robot stood."""
    stood = 0
    for seed in range(count):
        with (
            tempfile.TemporaryDirectory() as folder,
            bus(*OP3, "--from", "supine", "--seed", str(seed)) as path,
        ):
            play = [*GETUP, "play", "supine_roll_over", "--backend", "dynamixel", "--port", path]
            ended = subprocess.run(
                [*play, "--then", "limp", "--out", folder], capture_output=True, check=False
            )
            stood += ended.returncode == 0
            print(f"  rise {seed}: exit code {ended.returncode}", flush=True)
    return stood


def main(*, repeats: int = 500, rises: int = 0, json: Path | None = None) -> None:
    """Measure every client, idle and beside one busy process a core.

    Args:
        repeats: Repetitions of each operation.
        rises: Rises over the port, idle and busy.
        json: File for the results.
    """
    cores = os.cpu_count() or 1
    cases: dict[str, Any] = {"rest": measure_rest()}
    print(f"at rest: {cases['rest']['core_share']:.3f} of a core", flush=True)
    for load in (0, cores):
        kind = "busy" if load else "idle"
        with busy_processes(load):
            for name, client in CLIENTS.items():
                print(f"{name}, {kind}", flush=True)
                with bus(*client.bus) as path:
                    try:
                        cases[f"{name}, {kind}"] = measure_client(name, path, repeats)
                    except ImportError as error:
                        print(f"  skipped: {error}", file=sys.stderr)
            if rises:
                print(f"rises, {kind}", flush=True)
                cases[f"rises, {kind}"] = {"n": rises, "stood": count_rises(rises)}
    if json:
        record = {"name": "bus_clients", "n": repeats, "cores": cores, "cases": cases}
        json.write_text(dumps(record, indent=1) + "\n", "utf-8")


if __name__ == "__main__":
    tyro.cli(main)
