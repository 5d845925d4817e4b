"""The judge of a noisy line: what each simulated drive executed, against what the host said of each command.

The host's word is read from what `Drive.send` returns or raises, and from its notices. The truth is the simulated
drive's own: the lines that it executed. A command is never judged before its drive's next command is over, so that a
late execution counts too.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from multidrop.base.errors import Refused
from multidrop.families.lexium.simulator.device import MCodeDevice


class Word(Enum):
    """The host's word about a command."""

    DONE = "done"
    UNCONFIRMED = "unconfirmed"
    REFUSED = "refused"
    NOT_EXECUTED = "not executed"
    UNKNOWN = "unknown"


MISDEEDS = ("twice", "denied", "lost", "credited to the wrong drive", "an older value", "taken for a reply")
"""Misdeeds. `denied`: the host said that it was not executed, and it was. `lost`: the opposite."""
PERHAPS = re.compile(r"may have been executed|it was executed|not known whether|it was sent once|may be its running")
UNCONFIRMED = re.compile(r"not confirmed|not known whether")


def word(result: tuple[str, ...] | BaseException, notices: list[str], line: str) -> Word:
    """Read what the host says of a line. A failure that leaves no doubt says that it was not executed.

    The host may say that a line of its own was executed, as it put back an echo mode first.
    """
    if not isinstance(result, BaseException):
        return Word.UNCONFIRMED if any(UNCONFIRMED.search(each) for each in notices) else Word.DONE
    text = str(result)
    if PERHAPS.search(text):
        return Word.UNKNOWN
    if isinstance(result, Refused):
        return Word.REFUSED
    executed = f"'{line}' was executed"  # before something else failed, or behind a motion that had failed
    return Word.DONE if f"{executed} before " in text or text.endswith(executed) else Word.NOT_EXECUTED


class Witness:
    """The lines that one simulated drive executed, without those that only ask."""

    def __init__(self, device: Any, asks: Callable[[str], bool], refused: Callable[[Any], bool]) -> None:
        self.device = device
        self.executed: list[str] = []
        self.unwatched = device.execute
        """Executes a line that does not count."""
        self._asks, self._refused = asks, refused
        device.execute = self._seen

    @property
    def boots(self) -> int:
        """How often an MCode drive has begun again; a byte of noise can make it do so (^C)."""
        return self.device.power_unit.boots if isinstance(self.device, MCodeDevice) else 0

    def _seen(self, text: Any, now: float, **how: Any) -> Any:
        stored = getattr(self.device, "programming", None) is not None
        answer = self.unwatched(text, now, **how)
        line = str(text).strip()
        if line and not stored and not self._refused(answer) and not self._asks(line):
            self.executed.append(line)
        return answer


@dataclass
class Command:
    """A command that was sent, and what the host said of it."""

    drive: str
    text: str
    begun: int
    """The number of lines that the drive had executed when it was sent."""
    asks: bool = False
    """The command only prints."""
    word: Word = Word.UNKNOWN
    said: str = ""


@dataclass
class Ledger:
    """The counts, and each misdeed in words."""

    words: Counter[str] = field(default_factory=Counter)
    executed: int = 0
    counts: Counter[str] = field(default_factory=Counter)
    misdeeds: list[str] = field(default_factory=list)
    undetected: list[str] = field(default_factory=list)
    resets: int = 0
    """Restarts of drives by a byte that the noise made (^C)."""
    hangups: int = 0

    def add(self, other: Ledger) -> None:
        """Add the counts of another."""
        self.words += other.words
        self.counts += other.counts
        self.executed += other.executed
        self.resets += other.resets
        self.hangups += other.hangups
        self.misdeeds += other.misdeeds
        self.undetected += other.undetected

    @property
    def commands(self) -> int:
        """The number of judged commands."""
        return self.words.total()

    def misdeed(self, kind: str, text: str) -> None:
        """Note what must not happen."""
        self.counts[kind] += 1
        self.misdeeds.append(f"{kind}: {text}")

    def damage(self, kind: str, text: str) -> None:
        """Note what a checksum of seven bits, or a line without one, cannot show."""
        self.counts[kind] += 1
        self.undetected.append(f"{kind}: {text}")


class Judge:
    """Judges the commands of one line. `checked`: a checksum protects it, so that only the undetectable is forgiven."""

    def __init__(self, ledger: Ledger, witnesses: dict[str, Witness], checked: bool) -> None:
        self.ledger = ledger
        self.witnesses = witnesses
        self.checked = checked
        self.sent: dict[str, set[str]] = {name: set() for name in witnesses}
        """Every line that the host, or the test in its place, gave to a drive."""
        self._open: dict[str, Command] = {}

    def begins(self, drive: str, text: str, asks: bool) -> Command:
        """Note a command that is sent now."""
        self.sent[drive].add(text)
        return Command(drive, text, len(self.witnesses[drive].executed), asks)

    def ends(self, command: Command, result: tuple[str, ...] | BaseException, notices: list[str]) -> None:
        """Note what the host said of it; judge the one before it."""
        command.word, command.said = word(result, notices, command.text), str(result)
        self.ledger.words[command.word.value] += 1
        before = self._open.pop(command.drive, None)
        if not command.asks:
            self._open[command.drive] = command
        if before is not None:
            self._judge(before)

    def close(self) -> None:
        """Judge the last ones, and look for lines that were never sent."""
        for each in self._open.values():
            self._judge(each)
        self._open.clear()
        for name, witness in self.witnesses.items():
            for line, times in self._damaged(name, witness.executed):
                self.ledger.damage("undetected command", f"@{name} executed {line!r} {times} times, which was not sent")

    def _damaged(self, drive: str, lines: list[str]) -> Iterator[tuple[str, int]]:
        return ((line, times) for line, times in Counter(lines).items() if line not in self.sent[drive])

    def _judge(self, command: Command) -> None:
        executed = self.witnesses[command.drive].executed
        times = executed[command.begun :].count(command.text)
        self.ledger.executed += times > 0
        where = f"@{command.drive} {command.text!r}: the host said {command.said!r}, executed {times} times"
        if times > 1:
            self.ledger.misdeed("twice", where)
        if times and command.word in (Word.REFUSED, Word.NOT_EXECUTED):
            self.ledger.misdeed("denied", where)
        if not times and command.word is Word.DONE:
            if any(self._damaged(command.drive, executed[command.begun :])) or not self.checked:
                self.ledger.damage("reported as done and executed as another", where)
            else:
                self.ledger.misdeed("lost", where)
