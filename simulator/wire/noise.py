"""The faults of a wire: what they do to bytes, drawn from one seeded source in the order of the bytes."""

from __future__ import annotations

from collections.abc import Iterator
from random import Random

from simulator.cell.spec import Faults


def harmed(data: bytes, faults: Faults, rng: Random) -> bytes:
    """Return the bytes with some of them lost, doubled and with a bit flipped, and with others inserted."""
    if not faults.harmful:
        return data
    out = bytearray()
    for byte in data:
        if faults.insert and rng.random() < faults.insert:
            out.append(rng.randrange(256))
        if rng.random() < faults.drop:
            continue
        out.append(byte ^ (1 << rng.randrange(8)) if rng.random() < faults.flip else byte)
        if faults.double and rng.random() < faults.double:
            out.append(out[-1])
    return bytes(out)


def lateness(faults: Faults, rng: Random) -> float:
    """Draw the seconds by which a byte, and all that follow it, are late."""
    return rng.uniform(*faults.late_by) if faults.late and rng.random() < faults.late else 0.0


def pieces(data: bytes, faults: Faults, rng: Random) -> Iterator[tuple[float, bytes]]:
    """Divide bytes before each that is late; yield the seconds before each piece, and the piece."""
    begin, late = 0, 0.0
    for n in range(len(data)) if faults.late else ():
        if more := lateness(faults, rng):
            if data[begin:n]:
                yield late, data[begin:n]
                late = 0.0
            begin, late = n, late + more
    yield late, data[begin:]
