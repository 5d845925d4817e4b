"""What is read of an MCode drive for a person: settings, conditions, values for plots, and all of it for a snapshot."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

from multidrop.dialects.codec import End, Kind, Priority, Procedure, Request
from multidrop.dialects.errors import Diagnostic, NoAnswer, Refused
from multidrop.dialects.mcode.host import debugging
from multidrop.dialects.mcode.host.before_request import before_request, value_of
from multidrop.dialects.mcode.host.codec import EVERY_DRIVE
from multidrop.dialects.mcode.host.exchange import (
    REPEATS,
    check_printed,
    lacks_lines,
    note_error,
    once,
    printed_value,
    question,
    rest_of_list,
    sign,
    value,
)
from multidrop.dialects.mcode.host.motions import cause
from multidrop.dialects.mcode.host.operations import perform
from multidrop.dialects.mcode.host.state import MCodeState, refuse_in_program, who
from multidrop.dialects.mcode.manual import parameter_plan, points
from multidrop.dialects.mcode.manual import parameters as manual
from multidrop.dialects.mcode.manual.mnemonic import ENCODER, EVERY, EXPANDED, MDRIVE_ENCODER, Mnemonic
from multidrop.dialects.mcode.manual.parameters import Form, form_of
from multidrop.dialects.mcode.manual.points import EXPANDED_INPUTS, INPUTS
from multidrop.dialects.mcode.manual.program_file import LONGEST
from multidrop.dialects.mcode.manual.statements import UNNAMED
from multidrop.dialects.mcode.manual.table import lookup, words
from multidrop.dialects.program_files import LOCKED
from multidrop.dialects.state import DriveState
from multidrop.dialects.values import (
    VARIABLES,
    Conditions,
    Facts,
    Levels,
    Parameters,
    Part,
    Plan,
    Progress,
    Reading,
    Readings,
    Snapshot,
    Value,
    Values,
    printed_number,
)

# Settings, read in few bytes.
#
# Theory of operation. One PR prints as many settings as its line can hold, signed as every question of the host is.
# Settings of one digit need no separator. The set-ups of inputs, outputs and software limits, and the user's
# variables, print lines of their own, which a sync mark ends. Reading clears nothing: the host never reads ER here,
# not even after a NAK. A print has no effect, so a damaged one may be asked again. A line that the drive refuses is
# not asked again in pieces, since every refusal runs a resident OE subroutine. (MCode reference 5.1.64, 5.1.78,
# 5.1.93, 5.1.102, 5.1.134.)


ETHERNET = ("LMDOE", "LMDCE")
"""The products without a name."""
BETWEEN = ":"
"""Printed between two settings; no setting contains it."""
NOT_PRINTED = "the drive refuses the line in which it is asked (PR ER shows why), or prints another form"
USER = re.compile(r"([A-Z][A-Z0-9]{0,2}) *= *(?:([GL]) +)?(-?\d+(?:\.\d+)?)", re.I)
"""A line of PR UV: a variable with its scope, or a label with its address."""


def read(state: MCodeState, progress: Progress) -> Procedure[Readings]:
    """Read every setting that the drive prints. Raises Refused where it would store the questions, or NoAnswer."""
    if state.address in EVERY_DRIVE:
        raise Refused(f"'{state.address}' is every drive; name one")
    refuse_in_program(state)
    flag = yield from _print(state, "EF", [Form.DIGIT.value])
    state.error_flag_read(flag != ["0"])
    if not state.serial:
        prints_it = state.product.startswith("LM") or state.codec.party or state.codec.checksum  # others may refuse
        serial = (yield from _print(state, "SN", ["[!-~][ -~]*"])) if prints_it else None
        state.serial_read(serial[0] if serial else "")
    batches = list(_batches(state, manual.settings(state.product, state.version, state.part)))
    lists = manual.lists(state.product, state.version)
    total, values, unread = len(batches) + len(lists) + 1, dict[str, Value](), [*manual.unread(state.product)]
    if state.name and state.product not in ETHERNET:
        values["DN"] = state.name
    for done, batch in enumerate(batches):
        progress(done, total)
        texts = yield from _print(state, *items_and_forms(batch))
        if texts is None:
            unread += [(row.name, NOT_PRINTED) for row in batch]
        else:
            values |= {row.name: _value(form_of(row), text) for row, text in zip(batch, texts, strict=True)}
    for done, (word, numbers) in enumerate(lists.items(), len(batches)):
        progress(done, total)
        rows = rows_of_list(word, numbers, (yield from _numbered(state, word, numbers)))
        values |= rows
        unread += [(f"{word}{n}", "the drive does not print it") for n in numbers if f"{word}{n}" not in rows]
    users = yield from listed(state, "PR UV")
    progress(total, total)
    return _readings(state, values, unread, users)


def _readings(
    state: MCodeState, values: Mapping[str, Value], unread: Sequence[tuple[str, str]], users: Sequence[str]
) -> Readings:
    """Put units, defaults and the user's names to the values."""
    counts, table = manual.counting(values), words(state.product)

    def in_order(name: str) -> tuple[str, int]:  # S2 before S13
        letters = name.rstrip("0123456789")
        return letters, int(name[len(letters) :] or 0)

    rows = [manual.reading_of(name, values[name], table.get(name), counts) for name in sorted(values, key=in_order)]
    named = [row for line in users if (row := USER.fullmatch(line.strip())) is not None]
    for row in named:
        if (row[2] or "").upper() == "G":
            rows.append(Reading(row[1].upper(), float(row[3]) if "." in row[3] else int(row[3]), VARIABLES))
    if state.product in ENCODER | MDRIVE_ENCODER:
        *names, last = sorted(manual.COUNTED if manual.locks_resolution(state.product) else manual.COUNTED - {"MS"})
        here, other = ("encoder counts", "steps") if counts else ("steps", "encoder counts")
        why = f"the drive moves in {here} now, and prints only the values for these"
        unread = [*unread, (f"{', '.join(names)} and {last} for {other}", why)]
    return Readings(tuple(rows), tuple(unread), tuple(row[1].upper() for row in named if not row[2]))


def _batches(state: MCodeState, wanted: Sequence[Mnemonic]) -> Iterator[list[Mnemonic]]:
    """Divide the settings into lines that the drive's buffer holds.

    One whose form is uncertain takes no other with it.
    """
    mode, plain = state.codec, {Form.DIGIT, Form.WHOLE}
    room = LONGEST - len(f"PR ,{sign(state).item}") - (len(state.address) if mode.party else 0) - bool(mode.checksum)
    batch: list[Mnemonic] = []
    for row in wanted:
        forms = {form_of(each) for each in (*batch[-1:], row)}
        if batch and (len(items_and_forms([*batch, row])[0]) > room or (len(forms) > 1 and not forms <= plain)):
            yield batch
            batch = []
        batch.append(row)
    if batch:
        yield batch


def items_and_forms(batch: Sequence[Mnemonic]) -> tuple[str, list[str]]:
    """The items of PR for a batch, and the form of each value with the separator before it."""
    items, forms = "", list[str]()
    for before, row in zip([None, *batch], batch, strict=False):
        form = form_of(row)
        alone = before is None or (form_of(before) is Form.DIGIT and form is Form.DIGIT)
        items += ("" if before is None else "," if alone else f',"{BETWEEN}",') + row.name
        forms.append(f"{'' if alone else BETWEEN}{form.value}")
    return items, forms


def _print(state: MCodeState, items: str, forms: Sequence[str]) -> Procedure[list[str] | None]:
    """Print values; None where the drive refuses to, or prints what is not understood. Raises NoAnswer."""
    answer = "".join(f"(?:{form})" for form in forms)
    for _ in range(1 + REPEATS):
        yield from before_request(state, question(state, items, answer))
        reply = yield from once(state, question(state, items, answer))
        if reply.end is End.DONE:
            note_error(state, reply)
            found = re.fullmatch("".join(f"({form})" for form in forms), value(state, reply))
            assert found is not None
            return [each.removeprefix(BETWEEN).strip() for each in found.groups()]
        if reply.end is End.REFUSED and not reply.doubtful:
            state.error_flag_read(True)
            return None
        if reply.end is not End.NAK:
            state.reply_lost()
    if reply.end is not End.TIMEOUT:
        return None
    raise NoAnswer(f"{who(state)} does not reply as expected: its settings were not read ({reply.end.value})")


def _value(form: Form, text: str) -> Value:
    if form in (Form.DIGIT, Form.WHOLE):
        return int(text)
    if form is Form.FRACTION:
        return float(text)
    fields = [each.strip() for each in text.split(",")]
    numbers = tuple(int(each) if re.fullmatch(r"-?\d+", each) else each for each in fields)
    return numbers if len(numbers) > 1 else numbers[0]


def _numbered(state: MCodeState, word: str, numbers: Sequence[int]) -> Procedure[tuple[str, ...]]:
    """Print a list of known length, which ends with its last number; where that does not come, with a mark.

    Drives without an encoder may print its index mark, input 6, all the same.
    """
    if numbers[-1] != manual.LISTS[word][-1]:
        return (yield from listed(state, f"PR {word}"))
    yield from before_request(state, question(state, "EF", "[01]"))
    reply = yield list_request(state, word, numbers)
    if reply.end is End.DONE and not reply.doubtful and len(rows_of_list(word, numbers, reply.lines)) == len(numbers):
        return reply.lines
    state.reply_lost()
    return (yield from listed(state, f"PR {word}"))


def list_request(state: MCodeState, word: str, numbers: Sequence[int]) -> Request:
    last = rf" *{word} *= *{numbers[-1]} *(?:, *-?\d+ *)+"
    asked = state.codec.request(state.address, f"PR {word}")
    return replace(asked, kind=Kind.PRINT, expect=last, gather=True, rows=rf" *{word} *=.*")


def listed(state: MCodeState, text: str) -> Procedure[tuple[str, ...]]:
    """Print a list (`PR UV`, `L`) to its end. Raises NoAnswer where it may be incomplete."""
    stood = state.error
    for _ in range(1 + REPEATS):
        yield from before_request(state, question(state, "EF", "[01]"))
        reply = yield from once(state, state.codec.request(state.address, text))
        if reply.end in (End.REFUSED, End.NAK) or reply.prompt == "?":  # noise may have made another line of it
            state.error_possible()
        lines = reply.lines
        if state.codec.em != 0 or reply.end is not End.DONE:
            rest = yield from rest_of_list(state, Priority.OPERATOR)
            if rest is None or lacks_lines(reply, lines):
                stood = True
                continue
            state.synchronised()
            lines += rest
        whole = reply.end in (End.DONE, End.SILENT)
        if reply.end in (End.REFUSED, End.NAK):  # an earlier error looks like the refusal of an empty list
            whole = stood or (reply.end is End.NAK and bool(reply.lines))
        if whole:
            return tuple(line for line in lines if line)
    raise NoAnswer(f"{who(state)}: the list of '{text}' may be incomplete ({reply.end.value}); ask again")


def rows_of_list(word: str, numbers: Sequence[int], lines: Sequence[str]) -> dict[str, Value]:
    """The set-ups in the lines of PR IS, OS or LS, by number."""
    found: dict[str, Value] = {}
    for line in lines:
        row = re.fullmatch(rf"{word} *= *(\d+) *((?:, *-?\d+)+)", line.strip())
        if row is not None and int(row[1]) in numbers:
            found[f"{word}{int(row[1])}"] = tuple(int(each) for each in row[2].split(",")[1:])
    return found


def conflict(plan: Plan, others: Collection[str]) -> str:
    """Return the reason for which a name or party mode would disturb other drives of the line; empty: none."""
    final = {change.name: change.after for change in plan}
    if final.get("DN") in others:
        return f"another drive of the line is named {final['DN']}"
    return (
        "other drives share the line, and PY=0 would make this one reply to all of it"
        if (others and final.get("PY") == 0)
        else ""
    )


def ready(state: MCodeState) -> Procedure[str]:
    """Return the reason for which settings must not change now; empty: there is none."""
    if state.programming:
        return f"{who(state)} is in program mode and would store the settings: PG ends that"
    yield from before_request(state, question(state, "MV", "[01]"))
    said = yield from printed_value(state, "MV,BY,TE", r"[01][01]\d{1,3}")
    if said[:1] == "1":
        return f"{who(state)} moves: stop it first"
    if said[1:2] == "1":
        return f"{who(state)} runs a program: E ends it"
    if said[2:] not in ("", "0"):
        return f"{who(state)} has armed trips (TE={said[2:]}): TE=0 disarms them"
    return ""


def save(state: MCodeState) -> Procedure[None]:
    if state.programming:
        raise Refused(f"{who(state)} is in program mode and would store S: PG ends that")
    yield from perform(state, "S")


# Conditions: one print for the state; settings and set-ups once, and after each line.
#
# Theory of operation. The state is one signed PR of flags and values. ER is never read, since that clears it. Nothing
# is asked with EM=3, whose prints wait in a queue. A set-up prints a list, whose last line ends it. The target is
# known where the host sent the move: MA, or MR from a position that was read at rest.


STATE = ("EF", "BY", "MV", "VC", "MP", "DE", "ST", "P", "IN", "I5", "AF")
"""What changes by itself, or by a program; the flags first, which need no separator."""
SETTINGS = ("EE", "AS", "RC", "HC", "VI", "VM", "A", "D")
POINTS = ("S1", "S2", "S3", "S4")
"""The set-ups of an MDrivePlus."""
SETTLED = "IS1"
"""Among the facts once the set-ups were read."""
UNSURE = frozenset({"EE", "AS", "AF", "I5", "ST"})
"""Words that not every Lexium has."""
REFUSAL = "refuses to print its conditions"


def parts(state: MCodeState, facts: Facts) -> Sequence[Part[MCodeState]]:
    """The parts of a drive: its state, its settings, and its set-ups, which have another form on an MDrivePlus."""
    if state.codec.em == 3 or state.address in EVERY_DRIVE or state.programming:
        return ()
    found = [
        Part("state", partial(_state, before=facts)),
        Part("settings", partial(_values, names=SETTINGS), slow=True),
    ]
    if facts.get("BY") and SETTLED in facts:
        return found  # a list has no signature, and a program prints lines, too
    if not (lists := manual.lists(state.product, state.version)):
        return [*found, Part("points", partial(_values, names=POINTS), slow=True)]
    return found + [Part(word, partial(_list, word=word, numbers=rows), slow=True) for word, rows in lists.items()]


def _state(state: MCodeState, before: Facts) -> Procedure[Facts]:
    facts = dict((yield from _values(state, STATE)))
    facts[points.CAUSE] = cause(state.product, facts, before)
    state.program_read(error=bool(facts["EF"]), running=bool(facts["BY"]))
    position = facts["P"]
    at_rest = isinstance(position, int) and not facts["MV"] and not facts["BY"]
    state.seen_at_rest(position if at_rest and isinstance(position, int) else None)
    return facts


def _values(state: MCodeState, names: Sequence[str]) -> Procedure[Facts]:
    """Print values in one line. Raises Refused or NoAnswer, and reads no error.

    Asks the words that the product has; of an unknown product, those that every Lexium has.
    """
    table, known = words(state.product), state.product in EVERY
    batch = [table[name] for name in names if name in table]
    batch = [row for row in batch if (state.product in row.products if known else row.name not in UNSURE)]
    items, forms = items_and_forms(batch)
    answer = "".join(f"(?:{form})" for form in forms)
    yield from before_request(state, replace(question(state, items, answer), priority=Priority.POLL))
    reply = yield from once(state, replace(question(state, items, answer), priority=Priority.POLL))
    check_printed(state, reply, REFUSAL)
    found = re.fullmatch("".join(f"({form})" for form in forms), value(state, reply))
    assert found is not None
    facts: dict[str, Value] = {}
    for row, text in zip(batch, found.groups(), strict=True):
        fields = tuple(int(each) for each in text.removeprefix(BETWEEN).split(","))
        facts[row.name] = fields if form_of(row) is Form.FIELDS else fields[0]
    return facts


def _list(state: MCodeState, word: str, numbers: Sequence[int]) -> Procedure[Facts]:
    yield from before_request(state, replace(question(state, "EF", "[01]"), priority=Priority.POLL))
    reply = yield from once(state, replace(list_request(state, word, numbers), priority=Priority.POLL))
    check_printed(state, reply, REFUSAL)
    rows = rows_of_list(word, numbers, reply.lines)
    if reply.doubtful or len(rows) < len(numbers):
        state.reply_lost()
        raise NoAnswer(f"{who(state)}: the list of {word} may be incomplete, or another drive's")
    return rows


def fold(state: MCodeState, facts: Facts) -> tuple[Conditions, ...]:
    modes = f"EM{state.codec.em} CK{state.codec.checksum}"
    return (replace(points.conditions(state.product, facts, state.heading), modes=modes),)


# Values for plots: one signed print each, and never a word whose reading clears it.


NUMBER = r"-?\d{1,10}(?:\.\d+)?"


def check(state: MCodeState, word: str) -> str:
    """Check the form of a word, and that its reading clears nothing."""
    try:
        debugging.check_names(state, [word])
    except Diagnostic as wrong:
        raise Diagnostic(wrong.message.replace("be watched", "be polled"), wrong.where, wrong.hint) from None
    return word.upper()


def first(state: MCodeState, word: str) -> Procedure[float]:
    """Read a value; a name with VA is looked up first, since asking for one that is not there is an error."""
    refuse_in_program(state)
    found = yield from debugging.values(state, [word])
    if word not in found:
        raise Refused(f"{who(state)} has no variable {word}")
    return printed_number(who(state), word, found[word])


def again(state: MCodeState, word: str, priority: Priority) -> Procedure[float]:
    """Read a value. The error flag is noted and not cleared."""
    refuse_in_program(state)
    yield from before_request(state, replace(question(state, word, NUMBER), priority=priority))
    reply = yield replace(question(state, word, NUMBER), priority=priority)
    if reply.end is End.REFUSED:
        note_error(state, reply)
        raise Refused(f"{who(state)} refused 'PR {word}'")
    check_printed(state, reply)
    return float(value(state, reply))


# A snapshot. A locked program is not asked for, as the refusal would run a resident OE subroutine (5.1.75).


BAUDS = {48: 4800, 96: 9600, 19: 19200, 38: 38400, 11: 115200}
"""By BD (5.1.9)."""
SNAPSHOT_WORDS = ("P", "C1", "C2", "V", "BY", "IN", "I5")
"""The words of the state, as far as the product has them."""
OUTPUT_TYPES = range(16, 30)
"""Types of a point that is not an input (MDrivePlus: S<n>)."""
_LISTED = re.compile(r"(\d+)\s+(\S.*)")


def take(state: MCodeState, progress: Progress) -> Procedure[Snapshot]:
    """Read a drive. Raises Refused where it would store the questions, or NoAnswer."""
    readings = yield from read(state, progress)
    known, whole = words(state.product), state.product in EVERY
    asked = [word for word in SNAPSHOT_WORDS if word in known and (state.product in known[word].products or not whole)]
    items, pattern = '," ",'.join(asked), " ".join(r"-?\d{1,10}" for _ in asked)
    now = dict(zip(asked, map(int, (yield from value_of(state, items, pattern)).split()), strict=True))
    program, remarks = yield from _program(state, readings, running=bool(now["BY"]))
    found = snapshot_of(state, readings, now)
    return replace(
        found,
        name=state.name or UNNAMED,
        party=state.codec.party,
        baud=BAUDS.get(_whole(readings, "BD"), 0),
        program=program,
        remarks=(*remarks, *found.remarks),
    )


def snapshot_of(state: DriveState, readings: Readings, now: Mapping[str, int]) -> Snapshot:
    """Make the record of a drive from its settings and its state of the moment, by word."""
    remarks = []
    if now["V"]:
        remarks.append(f"moving at V={now['V']} while it was read: its position is one of that moment")
    if now["BY"]:
        remarks.append("a program ran while it was read")
    points = EXPANDED_INPUTS if state.product in EXPANDED else INPUTS
    types = {name: held for name, held in readings.values.items() if isinstance(held, tuple)}
    outputs = {n for n in points if types.get(f"S{n}", (0,))[0] in OUTPUT_TYPES}
    levels = Levels("IN", tuple((n, bit) for bit, n in enumerate(points) if n not in outputs))
    counts = _whole(readings, "EE") and not _whole(readings, "AS")
    other = "C1" if counts else "C2"
    return Snapshot(
        kind="mcode",
        product=state.product,
        part=state.part,
        version=state.version,
        serial=state.serial,
        name=UNNAMED,
        readings=readings,
        counters=({"position": (now["P"],)} | ({other: (now[other],)} if other in now else {})),
        inputs=levels.of(now["IN"]),
        levels=levels,
        active=bool(now["V"] or now["BY"]),
        analog=(now["I5"],) if "I5" in now else (),
        remarks=tuple(remarks),
    )


def _program(
    state: MCodeState, readings: Readings, running: bool
) -> Procedure[tuple[tuple[tuple[int, str], ...], list[str]]]:
    """Read the listing; one that a running program's prints may have come into is read twice."""
    if _whole(readings, "LK"):
        return (), [f"not read: {LOCKED}"]
    first = yield from listed(state, "L")
    if running and first != (yield from listed(state, "L")):
        return (), ["its program was not read: it runs, and its prints came between the lines"]
    found = [_LISTED.fullmatch(line.strip()) for line in first]
    lost = [line for line, row in zip(first, found, strict=True) if row is None]
    doubts = [f"its listing has a line that is not a program line: {line!r}" for line in lost]
    return tuple((int(row[1]), row[2]) for row in found if row is not None), doubts


def _whole(readings: Readings, name: str) -> int:
    found = readings.values.get(name, 0)
    return found if isinstance(found, int) else 0


PARAMETERS = Parameters(
    read=read,
    plan=lambda state, present, wanted, allowed: parameter_plan.plan(state.product, present, wanted, allowed),
    ready=ready,
    write=lambda state, change: perform(state, change.text),
    save=save,
    language="MCode",
    conflict=conflict,
    later=frozenset({"BD"}),
)
VALUES = Values(
    parameters=PARAMETERS,
    snapshot=take,
    parts=parts,
    fold=fold,
    check=check,
    first=first,
    again=again,
    controls=points.controls,
    actions=points.ACTIONS,
    own=lambda state, word: lookup(word.upper(), state.product) is not None,
)
