"""Samples as a blocking iterator."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Coroutine, Iterator
from typing import Any, Protocol, TypeVar

from multidrop.api.samples import Sample, Samples
from multidrop.api.telemetry import AsyncTelemetry
from multidrop.dialects import Diagnostic

T = TypeVar("T")


class Caller(Protocol):
    """The session of blocking calls."""

    def call(self, work: Callable[[], Coroutine[Any, Any, T]]) -> T:
        """Await work in the session's thread."""


class Telemetry:
    """Samples from now until `close`, the end of the session, or the loss of a line: iterate over it."""

    def __init__(self, session: Caller, telemetry: AsyncTelemetry) -> None:
        self._session, self._telemetry = session, telemetry

    @property
    def missed(self) -> int:
        """The number of samples that were dropped because the program did not take them."""
        return self._telemetry.missed

    def __enter__(self) -> Telemetry:
        """Return it; the end of the block closes it."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close it."""
        self.close()

    def close(self) -> None:
        """End it. Samples that came can still be taken. May be called again."""

        async def close() -> None:
            self._telemetry.close()

        with contextlib.suppress(Diagnostic):
            self._session.call(close)

    def __iter__(self) -> Iterator[Sample]:
        """Return it."""
        return self

    def __next__(self) -> Sample:
        """Wait for the next sample. Raises TransportLost once the samples before the loss are taken."""
        try:
            return self._session.call(self._telemetry.__anext__)
        except StopAsyncIteration:
            raise StopIteration from None

    def samples(self) -> Samples:
        """Take all samples that have come and were not taken yet."""
        return self._session.call(self._telemetry.samples)
