"""The state of drives after a stop, counted and in words: for banner, toolbar, standard error and /resume.

The words claim only what was read. A drive is at rest if its velocity was read as 0 since the stop and no program runs
in it; drives that the stop did not reach are named.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import datetime

from multidrop.drives.bus import Bus
from multidrop.drives.drive import Drive
from multidrop.drives.stopping import Fate, Halt

E_STOP = " - use the E-stop"
NOT_OPEN = "still being opened"
CLOSED = "closed since"
UNCONFIRMED = "had velocity 0 once, but not twice at one position"
COLUMN_GAP = "   "
RESUME = "/resume lets macros run"
MOST_NAMED_DRIVES = 8
"""The largest number of names in one place."""
PARTS = {
    Fate.STANDING: ("■", "at rest"),
    Fate.STARTED: ("■", "started again"),
    Fate.SENT: ("✗", "not read yet"),
    Fate.MOVING: ("▶", "STILL MOVING"),
    Fate.RUNNING: ("▷", "STILL RUNNING A PROGRAM"),
    Fate.NOT_KNOWN: ("?", "NOT KNOWN"),
    Fate.NOT_REACHED: ("‼", "NOT REACHED"),
}
"""The sign and the words of each fate, the most urgent one last."""
CALM = (Fate.STANDING, Fate.STARTED, Fate.SENT)
UNNAMED = (Fate.STANDING, Fate.SENT)
"""Fates shown by number, without names."""


@dataclass(frozen=True)
class DriveFate:
    """The fate of one drive; of a whole bus if no drive is known on it."""

    fate: Fate
    name: str
    bus: str
    why: str = ""
    """The reason why the stop did not reach its bus."""


@dataclass(frozen=True)
class FateTally:
    """The fates of the drives of a stop. `at` is its time of day."""

    at: datetime
    found: tuple[DriveFate, ...]
    vain: bool = False
    """A drive still moves, or its program runs, after several stops."""

    def of(self, fate: Fate) -> list[DriveFate]:
        return [drive for drive in self.found if drive.fate is fate]

    @property
    def stand(self) -> bool:
        """True if every drive was read at velocity 0 since the stop, and without a program that runs."""
        return all(drive.fate is Fate.STANDING for drive in self.found)

    @property
    def urgent(self) -> bool:
        """True if a drive may move that this program cannot stop."""
        return self.vain or bool(self.of(Fate.NOT_KNOWN) or self.of(Fate.NOT_REACHED))

    @property
    def sure(self) -> bool:
        """True if every drive was read since the stop, or was started again."""
        return all(drive.fate in (Fate.STANDING, Fate.STARTED) for drive in self.found)


def of_buses(
    buses: Iterable[Bus], at: datetime, stopped_at: float, several: bool, opening: Iterable[str] = ()
) -> FateTally:
    """The tally since the last stop of everything, at `stopped_at` of the session's clock.

    `opening`: the URLs that were being opened then and still are.
    """
    fates = [DriveFate(Fate.NOT_REACHED, url, url, NOT_OPEN) for url in opening]
    vain = False
    for bus in buses:
        halt = bus.last_stop
        if halt is None or halt.at < stopped_at:
            halt = Halt(bus.link, stopped_at, 0, True, tuple(bus.all_drives), trouble=["opened since"])
        vain = vain or halt.vain
        fates += _found(halt, bus.all_drives, several)
    return FateTally(at, tuple(fates), vain)


def in_doubt(tally: FateTally) -> list[DriveFate]:
    """The drives of a line that is being closed and that were not read at rest; the stop may not have reached them."""
    return [
        replace(
            drive,
            fate=drive.fate if drive.fate is Fate.NOT_REACHED else Fate.NOT_KNOWN,
            why=", ".join(filter(None, (drive.why, CLOSED))),
        )
        for drive in tally.found
        if drive.fate not in (Fate.STANDING, Fate.STARTED)
    ]


def of_halts(halts: Iterable[Halt], at: datetime, several: bool) -> FateTally:
    """The tally of stops of some drives each."""
    kept = list(halts)
    fates = [fate for halt in kept for fate in _found(halt, halt.affected, several)]
    return FateTally(at, tuple(fates), any(halt.vain for halt in kept))


def _found(halt: Halt, drives: Sequence[Drive], several: bool) -> Iterator[DriveFate]:
    bus = halt.link.name
    lost = "lost" if halt.link.loss else ""
    why = ", ".join(dict.fromkeys(reason for reason in (lost, *halt.trouble) if reason))
    if not drives:
        yield DriveFate(Fate.NOT_KNOWN if halt.data else Fate.NOT_REACHED, bus, bus, why)
    for drive in drives:
        name, part = drive.label or drive.address, halt.part_of(drive)
        yield DriveFate(
            halt.fate(drive), f"{bus}:{name}{part}" if several and name else f"{name or bus}{part}", bus, why
        )


def names(tally: FateTally, fate: Fate) -> str:
    """The drives with a fate by name, a whole bus by its own name, with the reason for a stop that failed."""
    listed: list[str] = []
    here = tally.of(fate)
    for bus in dict.fromkeys(drive.bus for drive in here):
        own = [drive for drive in here if drive.bus == bus]
        all_of_it = len(own) == sum(drive.bus == bus for drive in tally.found) and fate is Fate.NOT_REACHED
        reason = f" ({own[0].why})" if fate in (Fate.NOT_REACHED, Fate.NOT_KNOWN) and own[0].why else ""
        listed.append((bus if all_of_it else ", ".join(drive.name for drive in own[:MOST_NAMED_DRIVES])) + reason)
        if not all_of_it and len(own) > MOST_NAMED_DRIVES:
            listed[-1] += f" and {len(own) - MOST_NAMED_DRIVES} more"
    return ", ".join(listed)


def parts(tally: FateTally, *, named: bool = True, calm: bool = True) -> list[str]:
    """One part for each fate: `9 stand`, `1 NOT KNOWN: noisy`. Without `calm` only the alarming fates."""
    words = []
    for fate, (_, said) in PARTS.items():
        count = len(tally.of(fate))
        if count and (calm or fate not in CALM):
            who = f": {names(tally, fate)}" if named and fate not in UNNAMED else ""
            words.append(f"{count} {said}{who}")
    return words


def words(tally: FateTally) -> str:
    """The tally in one line, such as `velocity 0 was read from all 12`."""
    if not tally.found:
        return "no drive is open"
    if tally.stand:
        count = len(tally.found)
        who = tally.found[0].name if count == 1 else "both" if count == 2 else f"all {count}"
        return f"velocity 0 was read from {who}"
    return ", ".join(parts(tally)) + (E_STOP if tally.urgent else "")


def headline(tally: FateTally, width: int = 0) -> str:
    """The banner: the tally and what to do. With a `width`, the longest wording that fits."""
    ways = _ways(tally)
    return next((way for way in ways if not width or len(way) <= width), ways[-1])


def _ways(tally: FateTally) -> list[str]:
    """The wordings of the banner, from the longest to the shortest."""
    if tally.stand:
        sure = "■ STOPPED" if tally.found else "· NO STOP SENT"
        head = f"{sure}   {words(tally)}"
        return [f"{head}       {RESUME}", head, f"{sure}   {RESUME}"]
    clock = f"{tally.at:%H:%M:%S}"
    if tally.sure:
        return [
            COLUMN_GAP.join((f"■ STOP {clock}", *parts(tally), RESUME)),
            COLUMN_GAP.join(("■ STOP", *parts(tally, named=False))),
        ]
    tail = E_STOP if tally.urgent else ""
    head = f"{next(sign for fate, (sign, _) in reversed(PARTS.items()) if tally.of(fate))} STOP SENT"
    rows = (
        (f"{head} {clock}", *parts(tally)),
        (f"{head} {clock}", *parts(tally, calm=False)),
        (head, *parts(tally, calm=False)),
        (f"{head} {clock}", *parts(tally, named=False)),
        (head, *parts(tally, named=False, calm=False)),
    )
    unsure = sum(fate.fate not in CALM for fate in tally.found)
    return [*(COLUMN_GAP.join(row) + tail for row in rows), f"{head}{COLUMN_GAP}{unsure} NOT SURE{tail}"]


def last_seen(drive: Drive, now: float) -> str:
    """The last reading of a drive and its age. `now` is s of the session's clock."""
    seen = drive.seen
    since = max(drive.started_at, seen.at if seen else float("-inf"))
    if since == float("-inf"):
        return "not read yet"
    ago = f"{max(0.0, now - since):.0f} s ago"
    if seen is None or drive.started_at > seen.at:
        return f"started {ago} and not read since"
    if seen.velocity:
        return f"last seen moving at {seen.velocity} a second {ago}"
    return f"last seen {'standing' if seen.at_rest() else 'once at velocity 0'} {ago}"


def not_open(url: str) -> str:
    """A line for a URL that was being opened at the stop."""
    return f"{url}: stop not sent ({NOT_OPEN}): the stop is the first to be sent if it opens{E_STOP}"


def unreached(halts: Iterable[Halt], now: float) -> list[str]:
    """A line for each bus with drives that a stop did not reach, with their last readings."""
    lines = []
    for halt in halts:
        missed = []
        if not halt.delivered:
            missed = [drive for drive in halt.drives if halt.fate(drive) is Fate.NOT_REACHED]
        if missed or not (halt.data or halt.drives):
            seen = ", ".join(f"{drive.label or drive.address} {last_seen(drive, now)}".strip() for drive in missed)
            why = ", ".join(dict.fromkeys(halt.trouble)) or "a defect"
            lines.append(f"{halt.link.name}: stop not sent ({why}): {seen or 'its drives are not known'}{E_STOP}")
    return lines
