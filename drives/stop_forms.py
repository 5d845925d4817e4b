"""The bytes of a stop: for every language and setting on a link, each form once."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from multidrop.dialects import Codec, StopPiece
from multidrop.drives.apart import apart
from multidrop.drives.drive import Drive
from multidrop.drives.link import WrittenStop
from multidrop.drives.roster import Roster


@dataclass(frozen=True)
class StopForms:
    """The forms of a stop, of which the state of the wire selects one."""

    immediate: bytes
    unterminated: bytes
    """The same stop without any byte that ends a half-sent line."""
    repeats: tuple[StopPiece, ...]
    """The same stop, to be written piece by piece once it is quiet."""
    invalidate: bytes
    """Makes a half-sent line harmless; empty if none is needed."""
    framed: bool
    """Messages carry their length: one that has begun to leave must leave whole."""
    missed: tuple[Drive, ...] = ()
    """Drives whose dialect failed to make a stop."""

    def written(self, cut: bool) -> WrittenStop:
        """The stop to write. `cut`: a line may have been cut in two."""
        if cut and self.invalidate:
            return WrittenStop(self.unterminated + self.invalidate + self.immediate, True, self.repeats)
        return WrittenStop(self.immediate, False, self.repeats)


@dataclass(frozen=True)
class _Target:
    """A name to stop, and its drive if one is known."""

    name: str
    drive: Drive | None = None


_Groups = dict[tuple[Codec, bool], list[_Target]]
"""Targets by language, and whether that is certain."""


class _Collected:
    """The forms of several groups, each once."""

    def __init__(self) -> None:
        self.immediate: list[bytes] = []
        self.unterminated: list[bytes] = []
        self.repeats: list[StopPiece] = []
        self.invalidate: list[bytes] = []

    def add(self, codec: Codec, names: list[str], sure: bool) -> None:
        stop, unfinished = codec.stop(names, sure), codec.stop(names, sure, half_sent=True)
        pieces, invalidate = codec.stop_again(names, sure), codec.invalidate()
        if stop not in self.immediate:
            # Written at once, the reply to a second answered stop would collide with the reply to the first.
            collides = bool(self.immediate) and codec.stop_replies
            if collides:
                self.repeats.append(StopPiece(stop, pieces[0].quiet))
            else:
                self.immediate.append(stop)
                self.unterminated.append(unfinished)
            self.repeats += pieces
        if invalidate not in self.invalidate:
            self.invalidate.append(invalidate)


def stop_forms(roster: Roster, only: Iterable[Drive] | None = None) -> StopForms:
    """Make the bytes that stop these drives; by default all of the link, unlisted and probed ones included."""
    groups, forms = _groups(roster, only), _Collected()
    missed: list[Drive] = []
    for (codec, sure), members in groups.items():
        names, failed = [each.name for each in members], list[str]()
        with apart(f"the stop of {', '.join(names)} on {roster.link.name}", failed):
            forms.add(codec, names, sure)
        missed += [each.drive for each in members if each.drive is not None and failed]
    return StopForms(
        b"".join(forms.immediate),
        b"".join(forms.unterminated),
        tuple(forms.repeats),
        b"".join(forms.invalidate),
        any(codec.framed for codec, _ in groups),
        tuple(missed),
    )


def _groups(roster: Roster, only: Iterable[Drive] | None) -> _Groups:
    groups: _Groups = {}
    for drive in roster.all_drives if only is None else only:
        members = groups.setdefault((drive.codec, not drive.state.settings_unknown), [])
        members.append(_Target(drive.address or drive.state.name, drive))
    if only is None and (roster.probing or not groups):
        groups.setdefault((roster.family.codec, False), []).extend(_Target(name) for name in roster.probing)
    return groups
