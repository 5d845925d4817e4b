"""The host's knowledge of one drive, changed by named transitions only.

A conversation reads a `DriveState` and records each thing that it learns by calling a transition. A family with more to
know extends the class. No other module assigns to a field: a test holds that.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import ClassVar

from multidrop.dialects.codec import Codec

KEPT_ERRORS = 8


@dataclass(frozen=True)
class Owed:
    """An echo mode to restore in a drive, or a download to end, or settings, and how to recognise that drive.

    `serial` is empty where the drive does not report one; else it is compared, too, and neither version nor part is:
    noise can change both as they are read. `lines` restore settings; empty: it is one of the others.
    """

    em: int
    name: str
    product: str
    version: str
    part: str
    serial: str = ""
    lines: str = ""

    def like(self, state: DriveState) -> bool:
        """Whether this may be the same drive, apart from its serial number."""
        if (self.name, self.product) != (state.name, state.product):
            return False
        return bool(self.serial) or (self.version, self.part) == (state.version, state.part)


@dataclass(frozen=True)
class Remembered:
    """The memory of a drive from the last use of its port: a clue where to look, and never true by itself."""

    address: str
    name: str
    product: str
    version: str
    part: str
    serial: str
    party: bool
    checksum: int
    em: int


class ErrorsRead:
    """The numbers of the errors that were read of a drive, which cleared them, and whether one may be of a motion."""

    def __init__(self) -> None:
        self.count = 0
        self.at = -math.inf
        """When the last one was read, s; infinite until the conversation that has read it goes on."""
        self.moving = False
        """A motion was begun whose end was not judged yet."""
        self.program = False
        """One of these motions is that of a program, whose lines may be wrong."""
        self._last: tuple[int, ...] = ()

    def add(self, code: int) -> None:
        self._last, self.count, self.at = (*self._last[1 - KEPT_ERRORS :], code), self.count + 1, math.inf

    def date(self, now: float) -> None:
        """Give an error that was just read its time: a conversation has no clock."""
        self.at = min(self.at, now)

    def since(self, count: int) -> tuple[int, ...]:
        """The numbers that were read since `count` had this value, newest last, as far as they are kept."""
        return self._last[-(self.count - count) :] if self.count > count else ()

    def motion(self, begun: bool, program: bool = False) -> None:
        """Record that a motion was begun, by a program or by a line, or that the end of all is judged."""
        self.moving, self.program = begun, begun and (self.program or program)


@dataclass(eq=False)
class DriveState:
    """One drive: its codec, its identity, and what is uncertain about it."""

    title: ClassVar[str] = ""
    """What stands before its name or address in messages."""
    unnamed: ClassVar[str] = "the drive"
    """What it is called where it has neither."""
    codec: Codec
    address: str = ""
    name: str = ""
    """The name that the drive itself bears, also where the host does not use it as the address."""
    product: str = ""
    version: str = ""
    part: str = ""
    """The part number that it reports."""
    serial: str = ""
    """Its serial number, once read."""
    programming: bool = False
    """In program mode: the drive stores every line."""
    error: bool = False
    """The drive's error flag is set from before, or may be; the next refusal must be distinguished from it."""
    others_heard: bool = False
    """Bytes came without a request since the flag was seen clear: another program may have caused an error."""
    last_error: int = 0
    """The number of the last error that was read of it, which cleared it; 0: none was read."""
    errors: ErrorsRead = field(default_factory=ErrorsRead)
    """The errors that were read of it."""
    reply_pending: bool = False
    """A reply is outstanding and may arrive late; the next reply must be distinguished from it."""
    settings_unknown: bool = False
    """Its settings may have changed: they are read before the next request, and a stop takes every form."""
    running: bool = False
    """A program was started or seen to run."""
    unreferenced: frozenset[str] = frozenset()
    """The axes whose position does not count since a restart; the empty name is an only axis."""
    recounts: int = 0
    """How often something may have changed the length or the direction of what its axes count."""
    restore: Owed | None = None
    """Its settings before a conversation changed them for a while; None once they are restored."""
    sync_marks: int = 0
    """Sync marks printed so far; each mark has another number."""
    notes: list[str] = field(default_factory=list)
    """Warnings for a person, oldest first."""
    remarks: list[str] = field(default_factory=list)
    """Side effects of a line that a person typed, oldest first."""
    label: str = ""
    """The name that a person gave it, which is shown in place of its address."""
    stranger: str = ""
    """Why this device may be no drive of its family: multidrop sends it only what a person types. Empty: it is one."""

    # Messages for a person

    def note(self, warning: str) -> None:
        self.notes.append(warning)

    def remark(self, text: str) -> None:
        self.remarks.append(text)

    def take_messages(self) -> tuple[list[str], list[str]]:
        taken = self.notes, self.remarks
        self.notes, self.remarks = [], []
        return taken

    # Identity

    def identified(self, product: str, version: str, part: str = "", stranger: str = "") -> None:
        """Record what the device says of itself. `stranger`: why it may be no drive of the family."""
        self.product, self.version, self.part, self.stranger = product, version, part or self.part, stranger

    def named(self, name: str) -> None:
        self.name = name

    def serial_read(self, serial: str) -> None:
        self.serial = serial

    # Replies

    def reply_outstanding(self) -> None:
        self.reply_pending = True

    def synchronised(self) -> None:
        """Record that no reply is outstanding, after a sync mark or a prompt."""
        self.reply_pending = False

    def next_sync_mark(self) -> int:
        self.sync_marks += 1
        return self.sync_marks

    def stopped(self) -> None:
        """Record that a stop was written to the drive."""

    def line_invalidated(self) -> None:
        """Record that a half-sent line was made harmless, which a drive may take for an error."""

    def found_storing(self) -> None:
        self.programming = True

    # Settings and error flag

    def came_unasked(self) -> None:
        """Record bytes that no request asked for, unless a program of the drive prints."""
        self.others_heard = not self.running

    def settings_may_have_changed(self) -> None:
        """Record a restart, a lost reply to a setting, or a broadcast: the settings are unknown."""
        self.settings_unknown = True

    def restarted(self, alone: bool) -> None:
        """Record a sign-on, of this drive if it is `alone` on its line: it is set as it was saved."""
        self.settings_may_have_changed()

    def settings_confirmed(self) -> None:
        """Record that the drive replies in the known form."""
        self.settings_unknown = False

    def error_flag_read(self, flag: bool, code: int = 0) -> None:
        """Record the error flag. `code`: the number of the error, which the drive cleared as it was read."""
        self.error, self.others_heard = flag, self.others_heard and flag
        if code:
            self.last_error = code
            self.errors.add(code)

    # Reference

    def reference_lost(self, axes: Iterable[str]) -> None:
        """Record that positions of these axes count from wherever the drive was at its restart."""
        self.unreferenced |= frozenset(axes)

    def follows(self, before: DriveState) -> None:
        """Take over what is known of the same drive from before a lost connection."""
        self.reference_lost(before.unreferenced)
        self.last_error, self.errors.at = before.last_error, before.errors.at
        self.recounts = before.recounts + 1  # it was out of sight

    def referenced(self, *axes: str) -> None:
        """Record that a homing of these axes has ended, or that their position was set; none: of all axes."""
        self.unreferenced = self.unreferenced - frozenset(axes) if axes else frozenset()

    def counts_may_have_changed(self, restarted: bool = False) -> None:
        """Record that its settings may give a count another length or direction than when they were last read.

        `restarted`: it was switched off and on, or may have been, and is set as it was saved.
        """
        self.recounts += 1

    # What is to be restored

    def owes(self, owed: Owed) -> None:
        """Record the settings to restore, before they are changed for a while."""
        self.restore = owed

    def owes_nothing(self) -> None:
        """Forget the settings to restore: they are restored, or restoring is given up."""
        self.restore = None


def who(state: DriveState) -> str:
    """The drive in a message."""
    name = state.label or state.address
    return f"{state.title}{name}" if name else state.unnamed


class OfDrive:
    """What a family says of one drive, in a class for each subject. A class of a family knows its own kind of state."""

    state: DriveState

    def __init__(self, state: DriveState) -> None:
        self.state = state

    @classmethod
    def offers(cls, name: str) -> bool:
        """Whether a family has something of its own in place of the default."""
        having = [kind for kind in cls.__mro__ if name in vars(kind)]
        return having[0] is not having[-1]
