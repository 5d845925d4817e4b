"""A drive's transmitter: what waits to be sent, and for how long it is busy."""

from __future__ import annotations

from collections.abc import Sequence

from multidrop.simulator.lexium.ports.replies import PrintSeal
from multidrop.simulator.wire.baud import BITS_A_BYTE
from multidrop.simulator.wire.wire import Transmission

TRANSMIT_BUFFER = 256
"""Bytes that wait to be sent when a program's next print is lost (the manual names the error, not the size)."""


class Transmitter:
    """Bytes with the times at which they begin. `baud` 0: bytes take no time, and no print is lost."""

    def __init__(self, baud: int) -> None:
        self._byte_time = BITS_A_BYTE / baud if baud else 0.0
        self._busy_until = 0.0
        self.queue: list[Transmission] = []
        """What has not been taken yet."""
        self._seal = PrintSeal()

    def send(self, at: float, data: bytes, *, overheard: bool = False) -> None:
        """Send bytes."""
        if data:
            self.queue.append(Transmission(at, data, overheard))
            self._busy_until = max(self._busy_until, at) + len(data) * self._byte_time

    def send_prints(self, printed: Sequence[tuple[float, str]], *, checksummed: bool, overheard: bool) -> bool:
        """Send what a program has printed, with its times. Return False if the buffer was full and a print was lost."""
        kept = True
        for at, text in printed:
            if self._busy_until - at > TRANSMIT_BUFFER * self._byte_time > 0:
                kept = False
            else:
                self.send(at, self._seal.seal(text, checksummed), overheard=overheard)
        return kept

    def take(self) -> list[Transmission]:
        """Take what there is to send."""
        queue, self.queue = self.queue, []
        return queue
