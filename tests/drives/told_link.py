"""A link as far as pollers and looks for restarts ask it: it keeps what it is told, and its time is the loop's."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any


class ToldLink:
    """It is never away. `told`: text, address, and whether it is a warning; `events`: what was published."""

    name, away = "w", None

    def __init__(self) -> None:
        self.line = SimpleNamespace(printed_at=float("-inf"))
        self.told: list[tuple[str, str, bool]] = []
        self.events: list[Any] = []

    def now(self) -> float:
        return asyncio.get_running_loop().time()

    def notify(self, text: str, address: str = "", warning: bool = False) -> None:
        self.told.append((text, address, warning))

    def publish(self, event: Any) -> None:
        self.events.append(event)
