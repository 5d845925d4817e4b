"""The ends of conversations, and their witnesses: functions called with each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from multidrop.dialects import DriveState
from multidrop.drives.apart import apart
from multidrop.drives.events import Transaction

T = TypeVar("T")


@dataclass(frozen=True)
class Outcome(Generic[T]):
    """The end of a conversation: its result, or the error that it raised."""

    result: tuple[T, ...] = ()
    error: BaseException | None = None

    def value(self) -> T:
        """Return the result, or raise the error."""
        if self.error is not None:
            raise self.error
        return self.result[0]


@dataclass(frozen=True)
class Concluded:
    """A conversation that is over: its transactions in order, and how it ended."""

    state: DriveState
    transactions: tuple[Transaction, ...]
    outcome: Outcome[Any]
    unproven: str
    """The command with which it failed, if it is not known whether that was executed."""


Witness = Callable[[Concluded], None]


class Witnesses:
    """The functions called at the end of every conversation of a link, before its caller goes on; false without any."""

    def __init__(self, name: str) -> None:
        self._all: tuple[Witness, ...] = ()
        self._apart = apart(f"a witness of {name}")

    def __bool__(self) -> bool:
        return bool(self._all)

    def add(self, witness: Witness) -> Callable[[], None]:
        """Add one; the function returned removes it."""
        self._all = (*self._all, witness)

        def leave() -> None:
            self._all = tuple(each for each in self._all if each is not witness)

        return leave

    def report(self, concluded: Concluded) -> None:
        """Call each with a conversation that is over."""
        for witness in self._all:
            with self._apart:
                witness(concluded)
