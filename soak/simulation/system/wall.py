"""The time of day in the simulation: it follows the loop's clock from a fixed morning on, and may jump."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Iterator
from datetime import UTC, datetime, tzinfo
from types import SimpleNamespace
from typing import Any, Self

from soak.simulation.system.clock import SimulatedLoop

MORNING = datetime(2026, 3, 2, 6, 0, tzinfo=UTC)
PACKAGE = "multidrop."


class Wall:
    """The clock of day. `jump` sets it forward or back, as a person or a time server does."""

    def __init__(self, loop: SimulatedLoop) -> None:
        self.loop = loop
        self.ahead = 0.0

    def jump(self, seconds: float) -> None:
        """Set the clock by so many seconds."""
        self.ahead += seconds

    def time(self) -> float:
        """Seconds since 1970."""
        return MORNING.timestamp() + self.loop.now + self.ahead

    def time_ns(self) -> int:
        """Nanoseconds since 1970."""
        return round(self.time() * 1e9)

    @contextlib.contextmanager
    def installed(self) -> Iterator[None]:
        """Put it in place of `time` and `datetime` in every module of the product that is imported."""
        wall = self

        class Datetime(datetime):
            """`datetime` whose present is the wall's."""

            @classmethod
            def now(cls, tz: tzinfo | None = None) -> Self:
                """The present."""
                return cls.fromtimestamp(wall.time(), tz or UTC)

            def astimezone(self, tz: tzinfo | None = None) -> Self:
                """The same moment; this machine's zone is UTC here."""
                return super().astimezone(tz or UTC)

        def monotonic() -> float:
            return wall.loop.now

        def sleep(seconds: float) -> None:
            raise AssertionError("a thread of the product slept in the simulation")

        clock = SimpleNamespace(
            **{name: getattr(time, name) for name in ("strftime", "localtime", "gmtime", "perf_counter")},
            time=self.time,
            time_ns=self.time_ns,
            monotonic=monotonic,
            sleep=sleep,
        )
        before: list[tuple[Any, str, Any]] = []
        for name, module in sys.modules.copy().items():  # in one step: another thread may be importing
            if name.startswith(PACKAGE):
                for attribute, old, new in (("time", time, clock), ("datetime", datetime, Datetime)):
                    if getattr(module, attribute, None) is old:
                        before.append((module, attribute, old))
                        setattr(module, attribute, new)
        try:
            yield
        finally:
            for module, attribute, old in before:
                setattr(module, attribute, old)
