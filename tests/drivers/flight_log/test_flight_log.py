"""A flight log gives back what was flown, bit for bit, whatever happens to program or disk."""

import os
import resource
import shutil
import tracemalloc
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import orjson
import pytest
from flight_recording import make_cycle, write_flight
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from paths import TINY

from drivers import Cycle
from drivers.flight_log.foxglove import SCHEMAS
from drivers.flight_log.reader import Event, FlightRecord
from drivers.flight_log.writer import FlightLog
from robots import Posture, Robot, load_robot


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot(TINY)


@pytest.fixture(scope="module")
def flight(robot) -> list[Cycle]:
    return [make_cycle(robot, number) for number in range(1100)]  # more than a pack of rows


@pytest.fixture(scope="module")
def logged(robot, flight, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("logged") / "flight.mcap"
    with FlightLog(path, robot, start=robot.standing) as log:
        for cycle in flight:
            log.log(cycle)
    return path


@pytest.fixture(scope="module")
def short(robot, flight, tmp_path_factory) -> Path:
    """A log of some chunks, to be read many times."""
    path = tmp_path_factory.mktemp("short") / "flight.mcap"
    write_flight(path, robot, flight[:300])
    return path


def test_every_field_comes_back_bit_for_bit(logged, robot, flight):
    record = FlightRecord.load(logged, robot)
    assert record.cycles == len(flight)
    for part in fields(Cycle):
        parts = [getattr(cycle, part.name) for cycle in flight]
        for one in fields(parts[0]):
            flown = np.array([getattr(each, one.name) for each in parts])
            read = record.tracks[part.name][one.name]
            assert read.dtype == flown.dtype, (part.name, one.name)
            np.testing.assert_array_equal(read, flown, strict=True)
    assert not record.truncated and record.start is not None
    state, command = record.measurement(7), record.command(7)
    assert (state.time, state.voltage) == (flight[7].state.time, flight[7].state.voltage)
    assert np.array_equal(state.alert, flight[7].state.alert)
    assert np.array_equal(command.joint_pos, flight[7].sent.joint_pos)


def test_a_row_of_the_wrong_length_is_recorded_and_spoils_no_other(tmp_path, robot, flight):
    cycles, path = list(flight), tmp_path / "f"
    cycles[5] = replace(cycles[5], asked=replace(cycles[5].asked, joint_pos=np.zeros(7)))
    write_flight(path, robot, cycles)
    asked = FlightRecord.load(path).tracks["asked"]["joint_pos"]
    assert len(asked[5]) == 7
    for row in (4, -1):
        assert list(asked[row]) == cycles[row].asked.joint_pos.tolist()
    state = replace(flight[0].state, joint_current=np.zeros(7))
    write_flight(path, robot, [replace(flight[0], state=state)])
    with pytest.raises(ValueError, match=r"state has joint_current of shape \(1, 7\), expected"):
        FlightRecord.load(path)


def test_it_tells_whose_flight_it_was_and_what_happened(tmp_path, robot, flight):
    start = Posture(
        position=np.array([0.1, -0.2, 1 / 3]),
        orientation=np.array([0.6, 0.8, 0.0, 0.0]),
        joint_pos=np.array([2.9, 1e-17]),  # beyond the joints' range: a fallen robot may be
    )
    about = {"scene": "flat", "seed": 7, "speed": 0.1}
    with FlightLog(tmp_path / "f", robot, about=about, start=start) as log:
        log.event(0.0, "phase", "play")
        for cycle in flight[:3]:
            log.log(cycle)
        log.event(0.024, "fault", "joint 'elbow' is hot \udcff")
    record = FlightRecord.load(tmp_path / "f")
    assert (record.robot, record.joint_names) == (robot.name, robot.joint_names)
    assert (record.about, record.period) == (about, robot.control_period)
    assert record.events == (
        Event(0.0, "phase", "play", 0),
        Event(0.024, "fault", "joint 'elbow' is hot ?", 3),
    )
    assert record.start is not None
    for one in fields(Posture):
        assert np.array_equal(getattr(record.start, one.name), getattr(start, one.name))
    with pytest.raises(ZeroDivisionError), FlightLog(tmp_path / "g", robot) as log:
        log.log(flight[2])
        raise ZeroDivisionError("by none")
    record = FlightRecord.load(tmp_path / "g")
    assert not record.truncated
    assert record.events == (Event(0.016, "exception", "ZeroDivisionError: by none", 1),)
    for count in (1, 2, 3):  # earlier logs are moved and not written over
        write_flight(tmp_path / "h.mcap", robot, flight[:count])
    names = ("h.mcap.1", "h.mcap.2", "h.mcap")
    assert [FlightRecord.load(tmp_path / name).cycles for name in names] == [1, 2, 3]


def test_other_programs_find_topics_schemas_and_an_index(logged):
    with logged.open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert summary.statistics.message_count == 9 * 1100
        assert len(summary.chunk_indexes) > 1
        topics = {channel.topic: channel for channel in summary.channels.values()}
        own = {"/state", "/command_asked", "/command_sent", "/clips", "/timing", "/guidance"}
        assert set(topics) == own | SCHEMAS.keys()
        for topic, channel in topics.items():
            schema = summary.schemas[channel.schema_id]
            assert (channel.message_encoding, schema.encoding) == ("json", "jsonschema")
            described = orjson.loads(schema.data)
            assert described["type"] == "object"
            _, _, message = next(iter(reader.iter_messages(topics=[topic])))
            assert described["properties"].keys() == orjson.loads(message.data).keys()


@contextmanager
def room_for(size: int) -> Iterator[None]:
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_a_full_disk_stops_the_recording_and_not_the_robot(tmp_path, robot, flight):
    with FlightLog(tmp_path / "f", robot) as log:
        for cycle in flight[:200]:
            log.log(cycle)
        log.event(1.6, "phase", "on disk")
        with room_for((tmp_path / "f").stat().st_size + 100):
            log.event(1.6, "phase", "no more room")
            log.log(flight[200])
    assert log.fault == (
        f"flight log {tmp_path / 'f'}: File too large, recording stopped; "
        "at least its first 200 cycles can be replayed"
    )
    record = FlightRecord.load(tmp_path / "f")
    assert (record.cycles, record.truncated) == (200, True)
    assert [event.text for event in record.events] == ["on disk"]
    for room in (20, 700):  # full before the first chunk
        with room_for(room), FlightLog(tmp_path / "g", robot) as log:
            log.log(flight[0])
            log.event(0.0, "phase", "to disk at once")
        reason = "File too large, recording stopped; removed"
        assert log.fault == f"flight log {tmp_path / 'g'}: {reason}"
        assert not (tmp_path / "g").exists()


def test_a_log_whose_program_was_killed_holds_all_but_the_last_chunk(tmp_path, robot, flight):
    """What is in the file while the log is open is what a killed program leaves."""
    with FlightLog(tmp_path / "f", robot) as log:
        for cycle in flight[:300]:
            log.log(cycle)
        log.event(2.4, "fault", "battery out")
        for cycle in flight[300:303]:
            log.log(cycle)
        shutil.copy(tmp_path / "f", tmp_path / "killed")
    record = FlightRecord.load(tmp_path / "killed")
    assert record.truncated
    assert 300 <= record.cycles <= 303
    assert record.events[0].text == "battery out"
    assert "cut off" in record.describe()


def test_a_log_cut_anywhere_is_read_as_far_as_it_is_whole(short, tmp_path, flight):
    data = short.read_bytes()
    described = data.index(b"started") + 400  # the description is whole by then
    counts = set()
    for end in np.random.default_rng(5).integers(described, len(data), 6):
        for tail in (b"", bytes(100), bytes(50_000)):  # a power cut leaves zeros
            (tmp_path / "cut").write_bytes(data[:end] + tail)
            record = FlightRecord.load(tmp_path / "cut")
            assert record.truncated
            assert bool(tail) <= record.lost_bytes <= end + len(tail)
            flown = [cycle.state.time for cycle in flight[: record.cycles]]
            assert record.time.tolist() == flown
            counts.add(record.cycles)
    assert len(counts) > 2


def test_a_damaged_log_is_read_around_the_damage_and_never_wrong(short, tmp_path):
    whole, data = FlightRecord.load(short), short.read_bytes()
    rng, spoiled = np.random.default_rng(6), tmp_path / "spoiled"
    refused, shorter = 0, 0
    places = [rng.integers(0, len(data), rng.integers(1, 4)) for _ in range(30)]
    for damaged in [np.arange(4), *places]:  # the first: no MCAP file any more
        content = bytearray(data)
        for at in damaged:
            content[at] ^= 1 << rng.integers(8)
        spoiled.write_bytes(content)
        try:
            record = FlightRecord.load(spoiled)
        except ValueError as error:
            refused += 1
            assert str(error).startswith(f"flight log {spoiled}: ")
            assert "\n" not in str(error)
            continue
        kept = np.isin(whole.time, record.time)
        assert np.array_equal(record.time, whole.time[kept])
        if record.cycles:
            assert np.array_equal(record.sent["joint_pos"], whole.sent["joint_pos"][kept])
        if record.cycles < whole.cycles:  # else it was the index at the end
            shorter += 1
            assert record.truncated and record.lost_bytes > 0
    assert refused and shorter > 12


def chunk_places(data: bytes) -> list[tuple[int, int]]:
    """Return where the content of each chunk record begins, and its length."""
    at, places = 8, []
    while data[at] != Opcode.FOOTER:
        length = int.from_bytes(data[at + 1 : at + 9], "little")
        if data[at] == Opcode.CHUNK:
            places.append((at + 9, length))
        at += 9 + length
    return places


MOST_IN_CHUNK = 45  # cycles of the robot of these tests


@pytest.mark.parametrize("number", [0, -2])
@pytest.mark.parametrize("spoiled", [100, -8], ids=["content", "length"])
def test_a_damaged_chunk_costs_itself_alone(logged, tmp_path, number, spoiled):
    data = bytearray(logged.read_bytes())
    whole = FlightRecord.load(logged)
    start, length = [place for place in chunk_places(data) if place[1] > 5000][number]
    data[start + spoiled] ^= 0x10
    (tmp_path / "f").write_bytes(data)
    record = FlightRecord.load(tmp_path / "f")
    kept = np.isin(whole.time, record.time)
    assert np.array_equal(record.time, whole.time[kept])
    (lost,) = np.nonzero(~kept)
    assert len(lost) <= MOST_IN_CHUNK and np.all(np.diff(lost) == 1)
    assert bool(len(lost)) >= (spoiled > 0)  # a length alone may cost no cycle
    assert (record.start is None) == (0 in lost), "without its first cycle its start is unknown"
    assert record.truncated and record.lost_bytes < 1.5 * length  # with its index
    assert record.damage.startswith("records left out: ")
    assert f"damaged ({record.damage}): {record.lost_bytes} bytes lost" in record.describe()


def test_what_is_no_flight_log_or_not_this_robots_is_refused_in_one_line(logged, tmp_path, op3):
    path, altered = tmp_path / "notes.txt", logged.read_bytes().replace(b"0.008", b"0.004", 1)
    for content, fault in (
        (b"time,angle\n0.0,1.0\n", "not an MCAP file, expected a log of FlightLog"),
        (b"", "not an MCAP file, expected a log of FlightLog"),
        (b"\x89MCAP0\r\n", "damaged (it does not name its robot)"),
        (altered, "damaged (crc validation failed in DataEnd"),  # the control period
    ):
        path.write_bytes(content)
        with pytest.raises(ValueError) as refusal:
            FlightRecord.load(path)
        assert str(refusal.value).startswith(f"flight log {path}: {fault}")
        assert "\n" not in str(refusal.value)
    with pytest.raises(ValueError, match=r"it is of robot 'tiny', expected 'op3'"):
        FlightRecord.load(logged, op3)
    os.mkfifo(tmp_path / "fifo")
    with pytest.raises(ValueError, match=r"flight log .*fifo: it is a FIFO, expected a file"):
        FlightRecord.load(tmp_path / "fifo")


# Logs of other writers ---------------------------------------------------------------------------


def rewrite(
    log: Path,
    path: Path,
    message: bytes,
    compression: CompressionType = CompressionType.ZSTD,
    topic: str = "/state",
) -> bytearray:
    with log.open("rb") as source:
        (about,) = make_reader(source).iter_metadata()
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=1 << 40, compression=compression)
        writer.start()
        writer.add_metadata(about.name, about.metadata)
        writer.add_message(writer.register_channel(topic, "json", 0), 0, message, 0)
        writer.finish()
    return bytearray(path.read_bytes())


@pytest.mark.parametrize("compression", [CompressionType.NONE, CompressionType.ZSTD])
def test_logs_of_other_writers_are_read_however_they_are_packed(logged, tmp_path, compression):
    event = b'{"time": 0.5, "kind": "note", "text": "by hand"}'
    rewrite(logged, tmp_path / "f", event, compression, topic="/event")
    assert FlightRecord.load(tmp_path / "f").events == (Event(0.5, "note", "by hand", 0),)


def load_as(path: Path, data: bytearray, size: int) -> FlightRecord:
    [(start, _)] = chunk_places(data)
    data[start + 16 : start + 24] = size.to_bytes(8, "little")
    path.write_bytes(data)
    return FlightRecord.load(path)


def test_no_log_takes_the_memory_of_what_it_unpacks_to(logged, tmp_path):
    path, huge = tmp_path / "bomb", 8 << 30
    expected = rf"flight log .*bomb: damaged \(it unpacks to {huge} bytes, expected at most"
    with pytest.raises(ValueError, match=expected):
        load_as(path, rewrite(logged, path, bytes(1000)), huge)
    data = rewrite(logged, path, bytes(16 << 20))  # zeros that say that they are 100 bytes
    tracemalloc.start()
    try:
        record = load_as(path, data, 100)
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert "unpacks to 101 bytes or more, expected 100" in record.damage
    assert most < 8 << 20
