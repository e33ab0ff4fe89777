"""Fuzz everything that parses bytes of a servo bus, with random and mutated bytes.

The frame parser and the decoder of fast replies get good frames, damaged ones and noise in one
stream. They must neither crash nor hang, must find every intact frame, and may accept damaged
bytes as a frame only as often as a 16-bit CRC does by chance. The virtual servos get arbitrary
instructions; no register may ever hold an invalid value.

    python benchmarks/fuzz_protocol.py --bytes 10000000 --seed 0

Prints one line of JSON and exits with 1 if anything failed.
"""

from __future__ import annotations

import faulthandler
import json
import random
import sys
import time
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass

import tyro
from fuzz_chain import ChainTally, fuzz_chain
from fuzz_driver import DriverTally, fuzz_driver  # puts tests/support on the path

# isort: split
from fast_status import encode_fast_status  # pyright: ignore[reportMissingImports]

from drivers.dynamixel.protocol2 import (
    BROADCAST,
    HEADER,
    MAX_ID,
    MAX_LENGTH,
    PREFIX,
    Damaged,
    FrameParser,
    Instruction,
    Packet,
    Status,
    decode_fast_status,
)

ROUND = 50_000  # bytes after which the stream pauses and the parser gives up what has begun
HANG = 60.0  # s that a round may take before it counts as a hang; it takes some tens of ms
COLLISION = 2.0**-16
GUARD = bytes(2)
INSTRUCTIONS = [int(i) for i in Instruction if i != Instruction.STATUS]
TRICKY = bytes((0xFF, 0xFF, 0xFD, 0xFD, 0x00, 0x55, 0x01, 0xFE))
"""Bytes of which headers and stuffing are made."""


@dataclass
class Tally:
    """What came of a fuzz run."""

    bytes: int = 0
    intact: int = 0
    """Frames or answers that were sent whole."""
    found: int = 0
    lost: int = 0
    """Sent whole, and not found although no collision hid them."""
    damaged: int = 0
    """Refused for their CRC: each had one chance to pass."""
    collisions: int = 0
    """Accepted without having been sent."""
    expected_collisions: float = 0.0

    @property
    def has_failed(self) -> bool:
        """Whether the outcome is too bad to be chance."""
        bound = self.expected_collisions + 6.0 * self.expected_collisions**0.5 + 6.0
        return self.lost > 0 or self.collisions > bound


def draw_bytes(rng: random.Random, longest: int) -> bytes:
    """Draw bytes, every other time such as make headers and runs to stuff."""
    count = rng.randrange(longest + 1)
    return rng.randbytes(count) if rng.random() < 0.5 else bytes(rng.choices(TRICKY, k=count))


def draw_packet(rng: random.Random) -> Packet:
    """Draw an instruction or an answer."""
    longest = 300 if rng.random() < 0.05 else 24
    if rng.random() < 0.5:
        params = bytes((rng.randrange(256),)) + draw_bytes(rng, longest)
        return Packet(rng.randrange(MAX_ID + 1), Instruction.STATUS, params)
    device = BROADCAST if rng.random() < 0.2 else rng.randrange(MAX_ID + 1)
    return Packet(device, rng.choice(INSTRUCTIONS), draw_bytes(rng, longest))


def mutate(rng: random.Random, frame: bytes) -> bytes:
    """Damage bytes as a bad line does, and worse."""
    data = bytearray(frame)
    for _ in range(rng.randint(1, 3)):
        at = rng.randrange(len(data)) if data else 0
        kind = rng.randrange(6)
        if kind == 0 and data:
            data[at] ^= 1 << rng.randrange(8)
        elif kind == 1 and data:
            data[at] = rng.randrange(256)
        elif kind == 2:
            del data[at : at + rng.randint(1, 4)]
        elif kind == 3:
            data[at:at] = draw_bytes(rng, 6)
        elif kind == 4:
            del data[at:]
        elif len(data) > PREFIX:
            data[5:7] = rng.choice([draw_bytes(rng, 2), bytes((rng.randrange(256), 0))])
    return bytes(data)


def fuzz_parser(rng: random.Random, size: int) -> Tally:
    """Feed the parser a stream, in pieces of any length."""
    tally, parser = Tally(), FrameParser()
    while tally.bytes < size:
        faulthandler.dump_traceback_later(HANG, exit=True)
        stream, intact, sent = draw_stream(rng)
        found: list[Packet | Damaged] = []
        start = 0
        while start < len(stream):
            end = start + rng.choice((1, 7, 64, 1000, ROUND))
            found += parser.feed(stream[start:end])
            start = end
            assert parser.pending <= PREFIX + MAX_LENGTH
        found += parser.give_up()
        assert parser.pending == 0
        packets = [item for item in found if isinstance(item, Packet)]
        collisions = sum(packet not in sent for packet in packets)
        tally.bytes += len(stream)
        tally.intact += len(intact)
        tally.found += len(packets) - collisions
        tally.lost += 0 if collisions else count_missing(intact, packets)
        tally.collisions += collisions
    tally.damaged = parser.damaged
    tally.expected_collisions = parser.damaged * COLLISION
    return tally


def draw_stream(rng: random.Random) -> tuple[bytes, list[Packet], set[Packet]]:
    """Draw good frames, damaged ones and noise in one stream.

    Returns:
        The bytes; what is whole in them; and that with what was damaged (damage may leave a
        frame as it was).
    """
    parts: list[bytes] = []
    intact: list[Packet] = []
    sent: set[Packet] = set()
    length = 0
    while length < ROUND:
        kind = rng.random()
        if kind < 0.4:
            packet = draw_packet(rng)
            intact.append(packet)
            sent.add(packet)
            parts.append(packet.encode())
        elif kind < 0.8:
            packet = draw_packet(rng)
            sent.add(packet)
            # A frame cut inside its CRC may end with the first byte of the next and be whole
            # again, to the next one's loss: some bytes between them rule that out.
            parts.append(mutate(rng, packet.encode()) + GUARD)
        elif kind < 0.9:
            parts.append(draw_bytes(rng, 200))
        else:
            parts.append(HEADER + draw_bytes(rng, 12))
        length += len(parts[-1])
    return b"".join(parts), intact, sent


def count_missing(sent: Iterable[Packet], found: list[Packet]) -> int:
    """Count what was sent and does not come in the same order in what was found."""
    missing, start = 0, 0
    for packet in sent:
        try:
            start = found.index(packet, start) + 1
        except ValueError:
            missing += 1
    return missing


def fuzz_fast(rng: random.Random, size: int) -> Tally:
    """Feed the decoder of fast answers frames, damaged frames and noise."""
    tally = Tally()
    while tally.bytes < size:
        faulthandler.dump_traceback_later(HANG, exit=True)
        for _ in range(ROUND // 100):
            answers = [
                Status(rng.randrange(MAX_ID + 1), rng.randrange(256), draw_bytes(rng, 14))
                for _ in range(rng.randint(1, 20))
            ]
            lengths = [len(answer.data) for answer in answers]
            frame = encode_fast_status(answers)
            tally.bytes += len(frame)
            kind = rng.random()
            if kind < 0.2:
                tally.intact += len(answers)
                tally.found += len(decode_fast_status(frame, lengths))
                tally.lost += decode_fast_status(frame, lengths) != answers
                continue
            if kind < 0.9:
                frame = mutate(rng, frame)
            elif kind < 0.95:
                lengths = [rng.randrange(20) for _ in range(rng.randrange(25))]
            else:
                frame = draw_bytes(rng, 300)
            found = decode_fast_status(frame, lengths)
            good = next(
                (
                    i
                    for i, pair in enumerate(zip(found, answers, strict=False))
                    if pair[0] != pair[1]
                ),
                min(len(found), len(answers)),
            )
            tally.found += good
            tally.collisions += len(found) - good
            tally.damaged += len(found) < len(lengths)
    tally.expected_collisions = tally.damaged * COLLISION
    return tally


TARGETS: dict[str, Callable[[random.Random, int], Tally | ChainTally | DriverTally]] = {
    "parser": fuzz_parser,
    "fast": fuzz_fast,
    "chain": fuzz_chain,
    "driver": lambda rng, size: fuzz_driver(rng, size, mutate),
}


@dataclass(frozen=True, kw_only=True)
class Options:
    """Fuzz each end of the servo bus."""

    bytes: int = 1_000_000
    """Bytes for each target."""
    seed: int = 0
    only: str | None = None
    """Target to fuzz; default: all."""


def main(options: Options) -> int:
    """Run; return 1 if a target failed."""
    if options.only not in (None, *TARGETS):
        raise SystemExit(f"--only is {options.only}, expected {', '.join(TARGETS)}")
    report: dict[str, object] = {"seed": options.seed}
    failed = []
    for name, fuzz in TARGETS.items():
        if options.only not in (None, name):
            continue
        start = time.perf_counter()
        tally = fuzz(random.Random(f"{options.seed} {name}"), options.bytes)
        faulthandler.cancel_dump_traceback_later()
        report[name] = asdict(tally) | {"time_s": round(time.perf_counter() - start, 2)}
        if tally.has_failed:
            failed.append(name)
    print(json.dumps(report | {"failed": failed}))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Options)))
