"""The part of a session that its drives, programs and settings use."""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

if TYPE_CHECKING:
    import asyncio

    from multidrop.drives.drive import Drive
    from multidrop.shell.session import Session as Shell

T = TypeVar("T")


class Owner(Protocol):
    """The session of a drive."""

    @property
    def shell(self) -> Shell:
        """The session of the house."""

    async def call(self, work: Callable[[], Coroutine[Any, Any, T]], printed: list[str] | None = None) -> T:
        """Run work as a call of this session."""

    def moves(self, drive: Drive) -> asyncio.Lock:
        """The lock of a drive for moves of several lines."""
