"""The bytes of a stop of all drives of a line, in the forms of which the state of the wire selects one."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import zip_longest

from multidrop.base.isolation import isolated
from multidrop.dialects import Codec, Started, StopPiece
from multidrop.drives.drive import Drive
from multidrop.drives.line import divided
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
    gap: float = 0.0
    """The quiet time, s, between a stop and the next one, whose bytes would collide with the reply; 0: none replies."""

    @property
    def pieces(self) -> tuple[StopPiece, ...]:
        """All of it in pieces: for a stop that follows another one, and must not be written at once."""
        if any(repeat.data == self.immediate for repeat in self.repeats):
            return self.repeats
        return (StopPiece(self.immediate, self.gap), *self.repeats)

    def written(self, cut: bool) -> tuple[bytes, bool]:
        """The bytes to write, and whether they make a half-sent line harmless if they leave whole.

        `cut`: a line may have been cut in two.
        """
        if cut and self.invalidate:
            return self.unterminated + self.invalidate + self.immediate, True
        return self.immediate, False


def stop_forms(roster: Roster, only: Iterable[Drive] | None = None) -> StopForms:
    """Make the bytes that stop these drives; by default all of the link, unlisted and probed ones included.

    Each form of each language and setting is in it once.
    """
    groups: dict[tuple[Codec, bool], tuple[list[str], list[Drive]]] = {}
    for drive in roster.all_drives if only is None else only:
        state = drive.state
        names, drives = groups.setdefault((state.codec, not state.settings_unknown), ([], []))
        names.append(state.address or state.name)
        drives.append(drive)
    if only is None and (roster.probing or not groups):
        groups.setdefault((roster.family.codec, False), ([], []))[0].extend(roster.probing)
    immediate, unterminated, invalidate = list[bytes](), list[bytes](), list[bytes]()
    soon, late = list[list[StopPiece]](), list[StopPiece]()
    missed, framed, gap = list[Drive](), False, 0.0
    for (codec, sure), (names, drives) in groups.items():
        framed, failed = framed or codec.framed, list[str]()
        with isolated(f"the stop of {', '.join(names)} on {roster.link.name}", failed):
            stop, unfinished = codec.stop(names, sure), codec.stop(names, sure, half_sent=True)
            pieces, harmless = codec.stop_again(names, sure), codec.invalidate()
            if stop not in immediate:
                before, again = divided(pieces)
                gap = max(gap, before[0].quiet if codec.stop_replies else 0.0)
                # Written at once, the reply to a second answered stop would collide with the reply to the first.
                if immediate and codec.stop_replies:
                    before.insert(0, StopPiece(stop, gap))
                else:
                    immediate.append(stop)
                    unterminated.append(unfinished)
                soon.append(before)
                late += again
            if harmless not in invalidate:
                invalidate.append(harmless)
        if failed:
            missed += drives
    if len(soon) > 1:
        soon = [[piece for pieces in zip_longest(*soon) for piece in pieces if piece is not None]]
    repeats = (*(soon[0] if soon else ()), *late, *(roster.sweep if only is None else ()))
    joined = b"".join
    return StopForms(joined(immediate), joined(unterminated), repeats, joined(invalidate), framed, tuple(missed), gap)


def single_forms(started: Mapping[Drive, Started]) -> StopForms | None:
    """Make the bytes that stop what was started in these drives, and nothing else; None where a drive has no such stop.

    That needs a drive that is known to read lines, and whose settings are known.
    """
    pieces: list[StopPiece] = []
    framed, gap = False, 0.0
    for drive, what in started.items():
        unsure = drive.state.settings_unknown or drive.programming or drive.missing
        own = () if unsure else drive.codec.stop_started(drive.address, what)
        if not own:
            return None
        pieces += own
        framed = framed or drive.codec.framed
        gap = max(gap, *(each.quiet for each in divided(own)[0] if drive.codec.stop_replies), 0.0)
    first, *rest = pieces
    return StopForms(first.data, first.data, (*rest, *pieces), b"", framed, gap=gap)
