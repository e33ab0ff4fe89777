"""What a robot.toml says of the servo bus, and all that can be wrong with it by itself."""

from typing import Any

from robots.bus import WATCHDOG, BoardSettings, BusSettings, PortSettings
from robots.faults import shown
from robots.fields import Fields

BAUD_RATES = (9600, 57600, 115200, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 4_500_000)
"""What X-series servos can be set to [bit/s] (e-manual, Baud Rate)."""
MAIN_PORT = "main"  # name of the port when all joints share one
MAX_WATCHDOG = 2.54  # s, 127 steps of 20 ms (e-manual, Bus Watchdog)
MAX_BOARD_ID = 252


def read_bus(table: Any, joints: tuple[str, ...], faults: list[str]) -> BusSettings | None:
    """Read the bus table of a robot.toml; None when there is none."""
    if table is None:
        return None
    if not isinstance(table, dict):
        faults.append(f"bus is {shown(table)}, allowed a table")
        return None
    fields = Fields(table, "bus: ", faults)
    baud = fields.integer("baud", BAUD_RATES[0], BAUD_RATES[-1])
    if baud > 0 and baud not in BAUD_RATES:
        faults.append(f"bus: baud is {baud} bit/s, allowed {', '.join(map(str, BAUD_RATES))}")
    ports = _read_ports(table.get("ports"), joints, faults)
    return BusSettings(
        baud=baud,
        watchdog=fields.number("watchdog", MAX_WATCHDOG, "s") if "watchdog" in table else WATCHDOG,
        ports=ports,
        board=_read_board(table.get("board"), [port.name for port in ports], faults),
    )


def _read_ports(table: Any, joints: tuple[str, ...], faults: list[str]) -> tuple[PortSettings, ...]:
    if table is None:
        return (PortSettings(name=MAIN_PORT, joints=joints),)
    if not isinstance(table, dict) or not table:
        faults.append(f"bus: ports is {shown(table)}, allowed a table of port names and joints")
        return ()
    fields = Fields(table, "bus ports: ", faults)
    ports = tuple(PortSettings(name=name, joints=fields.texts(name)) for name in table)
    told = [joint for port in ports for joint in port.joints]
    faults += [f"bus ports: unknown joint {shown(j)}" for j in told if j not in joints]
    faults += [
        f"bus ports: joint {shown(joint)} is on {told.count(joint)} ports, allowed one"
        for joint in joints
        if told.count(joint) != 1
    ]
    return ports


def _read_board(table: Any, ports: list[str], faults: list[str]) -> BoardSettings | None:
    if table is None:
        return None
    if not isinstance(table, dict):
        faults.append(f"bus: board is {shown(table)}, allowed a table")
        return None
    fields = Fields(table, "bus board: ", faults)
    axes = table.get("imu_axes")
    if not isinstance(axes, list) or len(axes) != 3 or any(axis not in (-1, 1) for axis in axes):
        faults.append(f"bus board: imu_axes is {shown(axes)}, allowed three signs, -1 or 1")
        axes = [1, 1, 1]
    powers = table.get("powers_servos", False)
    if not isinstance(powers, bool):
        faults.append(f"bus board: powers_servos is {shown(powers)}, allowed true or false")
    return BoardSettings(
        model=fields.text("model"),
        id=fields.integer("id", 0, MAX_BOARD_ID),
        imu_axes=(axes[0], axes[1], axes[2]),
        powers_servos=bool(powers),
        port=fields.choice("port", ports) if "port" in table else (ports or [""])[0],
    )
