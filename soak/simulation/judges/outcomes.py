"""Rules of commands and values: the host's word about each, against the record of the drive that it was for.

Noise excepts little. Each byte that the simulated noise changed is in the history. So a grant holds only where noise
damaged that line in the time of that command; with a checksum only where the noise made what no host can know.
"""

from __future__ import annotations

import re
from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from contextlib import suppress
from math import inf

from multidrop.families.lexium.manual.errors import BY_ITSELF as MACHINES
from multidrop.transports.relay import GarbledFrame
from soak.languages import TICKS
from soak.simulation.judges.departures import for_drives
from soak.simulation.judges.rule import Grant, Granted, Lived, Rule
from soak.simulation.records.commands import Command, Outcome
from soak.simulation.records.history import NUMBER, Damage, Executed, Held, History, Shown

ACK, NAK = b"\x06", b"\x15"
AFTER = 2.0
"""The longest time, s, between a damaged byte of a line and the end of that line: late bytes, and a slow wire."""

PRINTED = re.compile(rb"(?:tick )?5\d{7}\r\n")
"""A line of the program that prints: see `soak.languages.PROGRAM`."""
LATE = re.compile(rb'PR [^\r\n]*\r\n[^\r\n]*"\w"\r\n')
"""A whole reply of MCode and the repetition of its question, which is not at the head of a line that it met."""
PROMPTLY = 0.1
"""The longest time, s, from a datagram's arrival to its execution."""
OUTAGE = 10.0
"""The longest time, s, in which a drive is without power, starts again, or owes a reply that was cut off."""

SEVEN_BITS = Grant("a checksum of seven or eight bits", "The checksum of CK has seven bits")
NOISY_ACK = Grant("an ACK of noise", "An ACK without its command")
NOISY_NAK = Grant("a NAK of noise", "A NAK of noise together with a lost ACK")
ASTRAY = Grant("a datagram that arrives twice or late", "A datagram that arrives twice or late")
STOPS_REPLY = Grant("a reply to a stop, late or to another client", "The reply to a stop")
BARE_REFUSAL = Grant("a refusal of noise, without a checksum", "A refusal without a checksum")
BARE_COMMAND = Grant("a damaged command without a checksum", "Noise on the line")
FLAG_CLEARED = Grant("a flag that a program clears", "A flag that a program clears")
NO_SIGN = Grant("a mode without a sign of execution", "0010")
ITS_OWN = re.compile(r"or that came by itself and it was executed|NAK, maybe for error (\d+)")
"""The host's words where a motion before the command may have had the error; the second names it."""
BY_ITSELF = Grant("an error that a motion may have had, too", "What a report means")
RUNS = Grant("a program that runs in the drive", "What a report means")
STOP_PIECE = re.compile(rb"ABORT|SR[01]=0")
"""A piece of a stop of PMX."""
BARE_VALUE = Grant("a damaged value without a checksum", "Noise on the line")


def _executions(life: Lived) -> dict[tuple[str, str, str], list[float]]:
    """The times at which each drive executed each line."""
    found: dict[tuple[str, str, str], list[float]] = {}
    for each in life.history.executed:
        found.setdefault((each.line, each.drive, each.text), []).append(each.at)
    return found


def _cases(life: Lived) -> Iterator[tuple[Command, list[float], str]]:
    """Every command that was typed once, when it was executed, and both in words."""
    executions = _executions(life)
    for each in life.history.commands.values():
        times = executions.get((each.line, each.drive, each.text), [])
        where = f"{each.line}:{each.drive} {each.text!r}"
        yield each, times, f"{where}: {each.outcome.value} ({each.said}), executed {len(times)} times"


def _damage(history: History, line: str, since: float, until: float) -> list[Damage]:
    """What noise changed on a line in a time."""
    found = history.damage.get(line, [])
    begin = bisect_left(found, since, key=lambda each: each.at)
    return found[begin : bisect_right(found, until, key=lambda each: each.at)]


def _made(history: History, command: Command, byte: bytes) -> bool:
    """Whether noise made a byte in the time of a command."""
    found = _damage(history, command.line, command.began, command.ended)
    return any(each.after.count(byte) > each.before.count(byte) for each in found)


def _took(history: History, command: Command, byte: bytes) -> bool:
    """Whether noise took a byte away in the time of a command."""
    found = _damage(history, command.line, command.began, command.ended)
    return any(each.after.count(byte) < each.before.count(byte) for each in found)


def became(life: Lived, line: str, at: float, since: float = inf) -> bool:
    """Whether noise can have made another line of what left, or of what came: on a line without a checksum."""
    return not life.place(line).checked and bool(_damage(life.history, line, min(at, since) - AFTER, at))


def _twice(life: Lived) -> Iterator[str | Granted]:
    for command, times, words in _cases(life):
        if len(times) <= command.times:
            continue
        if any(became(life, command.line, at) for at in times):
            yield Granted(BARE_COMMAND, words)
        elif _made(life.history, command, NAK) and _took(life.history, command, ACK) and _no_error(life, command):
            yield Granted(NOISY_NAK, words)
        elif _doubled(life, command) or astray(life, command.line, times[-1] - PROMPTLY, times[-1]):
            yield Granted(ASTRAY, words)  # a line of a download that came once program mode had ended, too
        else:
            yield words


def _no_error(life: Lived, command: Command) -> bool:
    """Whether the host read ER=0 in the time of a command: a signed print of 0."""
    received = life.history.received.get(command.line, [])
    heard = b"".join(data for at, data in received if command.began <= at <= command.ended)
    return re.search(rb'(?<!\d)0["~]', heard) is not None


def _doubled(life: Lived, command: Command) -> bool:
    """Whether the network delivered the datagram of a command twice."""
    place = life.place(command.line)
    return any(host == place.host and command.text.encode() in data for host, data in life.network.doubled)


def _denied(life: Lived) -> Iterator[str | Granted]:
    for command, times, words in _cases(life):
        if times and command.outcome is Outcome.NOT_SENT:
            yield Granted(BARE_COMMAND, words) if became(life, command.line, times[0]) else words


def _refused(life: Lived) -> Iterator[str | Granted]:
    for command, times, words in _cases(life):
        if times and command.outcome is Outcome.REFUSED:
            bare = not life.place(command.line).checked
            noise = _damage(life.history, command.line, command.began - AFTER, command.ended)
            noise = noise or _before(life, command)
            if astray(life, command.line, command.began - AFTER, command.ended):
                yield Granted(ASTRAY, words)
            else:
                yield Granted(BARE_REFUSAL, words) if bare and noise else words


def _before(life: Lived, command: Command) -> list[Damage]:
    """What noise changed in the time of the last command of the same drive: it may have been the error flag of that."""
    same = [each for each in life.history.commands.values() if (each.line, each.drive) == (command.line, command.drive)]
    ended = [each for each in same if each.ended <= command.began]
    if not ended:
        return []
    last = max(ended, key=lambda each: each.ended)
    return _damage(life.history, last.line, last.began, last.ended)


def _lost(life: Lived) -> Iterator[str | Granted]:
    for command, times, words in _cases(life):
        if not times and command.outcome is Outcome.OK:
            grant = _confirms_lost(life, command)
            yield Granted(grant, words) if grant else words


def _confirms_lost(life: Lived, command: Command) -> Grant | None:
    """What can have confirmed a command that was lost."""
    if astray(life, command.line, command.began, command.ended):
        return ASTRAY
    if _cleared(life, command):
        return FLAG_CLEARED
    if not life.place(command.line).checked:
        if _damage(life.history, command.line, command.began - AFTER, command.ended):
            return BARE_COMMAND
        return STOPS_REPLY if _stopped_by_another(life, command) else None
    if _made(life.history, command, ACK):
        return NOISY_ACK
    return SEVEN_BITS if _executed_as_another(life, command) else None


def _cleared(life: Lived, command: Command) -> bool:
    """Whether an input started a program in the time of a command that the error flag alone shows as refused."""
    place, started = life.place(command.line), life.history.told.started
    if place.em == 0 or (place.noisy and place.checksum):  # which a prompt or a NAK shows, too
        return False
    own = (at for at, line, drive in started if (line, drive) == (command.line, command.drive))
    return any(command.began <= at <= command.ended for at in own)


def astray(life: Lived, line: str, since: float, until: float) -> bool:
    """Whether a datagram of a line arrived twice or late in a time, or so before it that its reply came then."""
    host = life.place(line).host
    return any(name == host and since - AFTER <= at <= until for at, name in life.network.astray)


def arrived_late(life: Lived, executed: Executed) -> bool:
    """Whether a line was executed as its datagram arrived twice or late."""
    host = life.place(executed.line).host
    return any(name == host and executed.at - PROMPTLY <= at <= executed.at for at, name in life.network.astray)


def _stopped_by_another(life: Lived, command: Command) -> bool:
    """Whether a PMX replied, about the time of a command, to a stop that is not of its own client."""
    history = life.history
    since = command.began - AFTER
    passed = [at for at, line in history.passed if line == command.line and since <= at <= command.ended]
    client = command.line + command.who
    own = [at for at, port, data in history.written if port == client and STOP_PIECE.search(data)]
    others = any(not any(at - PROMPTLY <= each <= at for each in own) for at in passed)
    return others and life.place(command.line).language == "pmx"


def _executed_as_another(life: Lived, command: Command) -> bool:
    """Whether a drive of the line executed, in the time of a command, what nobody sent."""
    sent = {(each.line, each.text) for each in life.history.commands.values()}
    return any(
        (each.line, each.text) not in sent
        for each in life.history.executed
        if each.line == command.line and command.began <= each.at <= command.ended
    )


def _unknown(life: Lived) -> Iterator[str | Granted]:
    """A drive may owe a reply that was cut off: until it has come, a sign on its line may be its own."""
    if not life.climate.calm:
        return
    history = life.history
    stops = [each.at for each in history.stops] + history.told.halts + [at for at, _ in history.passed]
    stops += history.deaths + history.began[1:]  # the next session finds what was cut off
    early = [(run.began, run.ended + OUTAGE) for run in history.told.runs.values() if run.failure]
    for command, _, words in _cases(life):
        if command.outcome is not Outcome.UNKNOWN or command.said == "cancelled":
            continue
        if any(began <= command.ended and command.began <= ended for began, ended in early):  # which stops drives
            continue
        switched = [at for (line, _), times in life.cut.items() if line == command.line for at in times]
        if any(command.began - OUTAGE <= at <= command.ended for at in (*stops, *switched)):
            continue
        runs = command.ended >= history.told.programs.get(command.line, inf)
        grant = NO_SIGN if life.place(command.line).em == 2 else RUNS if runs else None
        own = ITS_OWN.search(command.said)
        grant = BY_ITSELF if own and (own[1] is None or int(own[1]) in MACHINES) else grant
        yield Granted(grant, words) if grant else words


def _half(life: Lived) -> Iterator[str | Granted]:
    """A drive executes the beginning of a line, which nobody has typed as a line of its own."""
    history = life.history
    told = history.told
    typed = {(each.line, each.text) for each in history.commands.values()}
    typed |= {(line, text) for line, _, text in told.repeated} | {(each.line, each.text) for each in told.stored}
    typed |= {(line, text) for run in told.runs.values() for line, _, text in (*run.texts, *run.on_early_end)}
    for each in history.executed:
        if (each.line, each.text) in told.half:
            yield f"{each.line}:{each.drive} executed {each.text!r} at {each.at:.3f}, which a client has only begun"
        if not NUMBERED.fullmatch(each.text) or (each.line, each.text) in typed:
            continue
        whole = [text for line, text in typed if line == each.line and text.startswith(each.text)]
        if whole:
            words = f"{each.line}:{each.drive} executed {each.text!r} at {each.at:.3f}, which begins {whole[0]!r}"
            noise = _damage(history, each.line, each.at - AFTER, each.at)
            grant = SEVEN_BITS if life.place(each.line).checked else BARE_COMMAND
            yield Granted(grant, words) if noise else words


# Values


def _credited(life: Lived) -> Iterator[str | Granted]:
    history = life.history
    numbers = {each.number: each for each in history.held}
    for shown in history.shown:
        own = [each for each in history.held if (each.line, each.drive) == (shown.line, shown.drive)]
        own = [each for each in own if each.at <= shown.at]
        if any(shown.form.format(each.number) == shown.text for each in own if each.until >= shown.began):
            continue
        if _saved(history, shown, own):
            continue
        if set(re.findall(r"\d", shown.text)) == {"0"} and (shown.line, shown.drive) in life.cut:
            continue  # what a power-up leaves
        words = f"{shown.line}:{shown.drive} printed {shown.text!r}, asked at {shown.began:.3f}"
        breach: str | Granted = ""
        if origin := _origin(shown, numbers):
            breach = f"{words}: {origin}"
            if life.place(shown.line).language == "pmx" and _damage(history, shown.line, shown.began, shown.at):
                breach = Granted(BARE_VALUE, words)  # noise made the number of another controller of that of the first
            elif origin == OF_A_PROGRAM and _asked_r3(life, shown):
                breach = Granted(BARE_VALUE, words)
        elif own and all(each.restarts == shown.restarts for each in own if each.until >= shown.began):
            breach = _never_held(life, shown, f"{words}: it never held that")
        if breach:
            late = astray(life, shown.line, shown.began, shown.at) or _overtaken(life, shown)
            yield Granted(ASTRAY, words) if late else breach


SAVES = ("S", "STORE")
OF_A_PROGRAM = "a program printed it"


def _saved(history: History, shown: Shown, own: list[Held]) -> bool:
    """Whether a drive that restarted printed what it had saved before."""
    place = shown.line, shown.drive
    saves = [each.at for each in history.executed if (each.line, each.drive) == place and each.text in SAVES]
    earlier = (each for each in own if each.restarts < shown.restarts and shown.form.format(each.number) == shown.text)
    return any(each.at <= at < each.until for each in earlier for at in saves)


def _origin(shown: Shown, numbers: dict[str, Held]) -> str:
    """Say whose value was shown, if it is another drive's, an older one, or a program's."""
    for number in re.findall(NUMBER, shown.text):
        held = numbers.get(number)
        own = held is not None and (held.line, held.drive) == (shown.line, shown.drive) and held.until >= shown.began
        if held is not None and not own:
            return f"{held.line}:{held.drive} held it from {held.at:.3f} to {held.until:.3f}"
        if TICKS <= int(number) < TICKS + 1_000_000:
            return OF_A_PROGRAM
    return ""


def _asked_r3(life: Lived, shown: Shown) -> bool:
    """Whether noise, on a line without a checksum, made R3 of what was asked for: the program counts in it."""
    found = _damage(life.history, shown.line, shown.began, shown.at)
    made = any(each.after.count(b"3") > each.before.count(b"3") for each in found)
    return made and not life.place(shown.line).checked


def _never_held(life: Lived, shown: Shown, words: str) -> str | Granted:
    """Except a value that noise damaged, where no checksum showed that, or where it was right."""
    place, history = life.place(shown.line), life.history
    heard = _heard(life, shown)
    if not _damage(history, shown.line, shown.began - AFTER, shown.at):
        harmed = not place.checked and (_divided(history, shown, heard) or _late_beside(life, shown))
        return Granted(BARE_VALUE, words) if harmed else words
    if not place.checked:
        return Granted(BARE_VALUE, words)
    right = _sealed_frame if place.language == "tmcl" else _sealed_line
    return Granted(SEVEN_BITS, words) if right(heard, shown.text) else words


def _late_beside(life: Lived, shown: Shown) -> bool:
    """Whether another drive of the line did not reply in time: its late reply may have met this one on the wire."""
    others = [f"{name} does not reply" for name in life.place(shown.line).names if name != shown.drive]
    said = [text for at, text in life.history.notices if shown.began - AFTER <= at <= shown.at]
    return any(text.startswith(each) for text in said for each in others)


def _heard(life: Lived, shown: Shown) -> bytes:
    """What the drives of a line sent since a question; of a relay without its frames."""
    received = life.history.received.get(shown.line, [])
    heard = b"".join(data for at, data in received if shown.began <= at <= shown.at)
    with suppress(GarbledFrame):  # it begins within a frame
        return for_drives("ssh", heard) if life.place(shown.line).kind == "ssh" else heard
    return heard


def _endings(history: History, shown: Shown) -> list[bytes]:
    """The values that the drive held then, and which end with what was shown."""
    own = [each for each in history.held if (each.line, each.drive) == (shown.line, shown.drive)]
    texts = [shown.form.format(each.number) for each in own if each.at <= shown.at and each.until >= shown.began]
    return [each.encode() for each in texts if each.endswith(shown.text)]


def _divided(history: History, shown: Shown, heard: bytes) -> bool:
    """Whether another drive printed while the value came, so that what was shown is its end.

    It was a program's print, or a late reply.
    """
    wholes = [each.sub(b"", heard) for each in (PRINTED, LATE)]
    endings = _endings(history, shown)
    return any(each in whole and each not in heard for whole in wholes for each in endings)


def _overtaken(life: Lived, shown: Shown) -> bool:
    """Whether a datagram with the end of the value came, and not yet the one with its beginning."""
    host = life.place(shown.line).host
    ways = [(left, arrives) for left, arrives, name in life.network.overtaken if name == host]
    late = any(shown.began <= left <= shown.at < arrives for left, arrives in ways)
    return late and bool(_endings(life.history, shown))


def _sealed_line(heard: bytes, text: str) -> bool:
    """Whether a line of MCode with this text came with a right check byte: all seven-bit sums are 0."""
    lines = re.split(rb"[\n\x06\x15]", heard.replace(b"\r", b""))
    return any(text.encode("latin-1") in each and each[-1] & 0x80 and not sum(each) & 0x7F for each in lines)


def _sealed_frame(heard: bytes, text: str) -> bool:
    """Whether a TMCL frame with this value came with a right check byte: the sum of the eight bytes before."""
    frames = (heard[at : at + 9] for at in range(len(heard) - 8))
    return any(
        sum(each[:8]) & 0xFF == each[8] and str(int.from_bytes(each[4:8], "big", signed=True)) == text
        for each in frames
    )


NUMBERED = re.compile(r"(?:[A-Z]\w*[ =]|X|SAP 194, 0, |MVP ABS, 0, )\d+")
"""The lines of the acts, which end with a number, and their beginnings."""
NOISE = "Noise on the line"
OUTCOMES = (
    Rule(
        "twice",
        "No command is executed twice.",
        "What is never done twice",
        _twice,
        (BARE_COMMAND, NOISY_NAK, ASTRAY),
    ),
    Rule("denied", "What was said to be not sent was not executed.", NOISE, _denied, (BARE_COMMAND,)),
    Rule("refused", "What was said to be refused was not executed.", NOISE, _refused, (BARE_REFUSAL, ASTRAY)),
    Rule(
        "lost",
        "What was said to be done was executed.",
        NOISE,
        _lost,
        (BARE_COMMAND, NOISY_ACK, SEVEN_BITS, STOPS_REPLY, FLAG_CLEARED, ASTRAY),
    ),
    Rule(
        "unknown",
        "Without faults a command is not known only where a stop, a kill or a power-off cut it.",
        "What a report means",
        _unknown,
        (NO_SIGN, RUNS, BY_ITSELF),
    ),
    Rule("half", "No part of a line is executed.", "What a stop promises", _half, (SEVEN_BITS, BARE_COMMAND)),
    Rule(
        "credited",
        "A value is credited to the drive that gave it, and to the question that asked for it.",
        NOISE,
        _credited,
        (BARE_VALUE, SEVEN_BITS, ASTRAY),
    ),
)
