"""How the frames of a language are sealed: the bytes of a line with its checksum, and how that is formed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple


@dataclass(frozen=True)
class SealedFrame:
    """The bytes of a line as they are sent."""

    sent: bytes
    check: bytes = b""
    """The checksum among them; empty: the language has none."""
    steps: Sequence[str] = ()
    """How it is formed, a line each."""


class LineChecksum(NamedTuple):
    """A way to seal a line: in the record of a family."""

    name: str
    """Its name in `multidrop checksum`."""
    title: str
    place: str
    """Module and function, `(text, address) -> SealedFrame`; the function raises Diagnostic for a wrong text."""

    def claims(self) -> tuple[str, ...]:
        """What only one family can add."""
        return (f"checksum {self.name}",)


def sums(data: bytes) -> str:
    """The bytes as a sum: `4D + 52 = 9F`, for at most a dozen of them."""
    shown = " + ".join(f"{byte:02X}" for byte in data) if len(data) <= MOST_SHOWN else f"the sum of {len(data)} bytes"
    return f"{shown} = {sum(data):X} hex"


MOST_SHOWN = 16
"""The greatest number of bytes that a sum shows one by one."""
