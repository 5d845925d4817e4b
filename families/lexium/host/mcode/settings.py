"""The settings of an MCode drive: read in few bytes, set up, and saved."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace

from multidrop.base.errors import NoAnswer, Refused
from multidrop.dialects.codec import End, Kind, Priority, Procedure, Request
from multidrop.dialects.state import who
from multidrop.dialects.values import (
    VARIABLES,
    Plan,
    Progress,
    Reading,
    Readings,
    Value,
)
from multidrop.families.lexium.host.mcode.before_request import before_request
from multidrop.families.lexium.host.mcode.codec import EVERY_DRIVE
from multidrop.families.lexium.host.mcode.exchange import (
    QUESTION_REPEATS,
    lacks_lines,
    note_error,
    printed_value,
    question,
    rest_of_list,
    send_once,
    sign,
    value,
)
from multidrop.families.lexium.host.mcode.operations import MCodeOperations
from multidrop.families.lexium.host.mcode.state import MCodeState, refuse_in_program
from multidrop.families.lexium.host.parameters import LexiumParameters
from multidrop.families.lexium.host.values import rows_of_list
from multidrop.families.lexium.manual import parameters as manual
from multidrop.families.lexium.manual.groups import BANKED, COUNTED, LISTS
from multidrop.families.lexium.manual.mnemonic import ENCODER, MDRIVE_ENCODER, Mnemonic
from multidrop.families.lexium.manual.parameters import SettingForm, form_of
from multidrop.families.lexium.manual.program_file import LONGEST_PROGRAM_LINE
from multidrop.families.lexium.manual.table import words

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
VALUE_SEPARATOR = ":"
"""Printed between two settings; no setting contains it."""
NOT_PRINTED = "the drive refuses the line in which it is asked (PR ER shows why), or prints another form"
USER = re.compile(r"([A-Z][A-Z0-9]{0,2}) *= *(?:([GL]) +)?(-?\d+(?:\.\d+)?)", re.I)
"""A line of PR UV: a variable with its scope, or a label with its address."""


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
        *names, last = sorted(COUNTED if manual.locks_resolution(state.product) else BANKED)
        here, other = ("encoder counts", "steps") if counts else ("steps", "encoder counts")
        why = f"the drive moves in {here} now, and prints only the values for these"
        unread = [*unread, (f"{', '.join(names)} and {last} for {other}", why)]
    return Readings(tuple(rows), tuple(unread), tuple(row[1].upper() for row in named if not row[2]))


def _batches(state: MCodeState, wanted: Sequence[Mnemonic]) -> Iterator[list[Mnemonic]]:
    """Divide the settings into lines that the drive's buffer holds.

    One whose form is uncertain takes no other with it.
    """
    mode, plain = state.codec, {SettingForm.DIGIT, SettingForm.WHOLE}
    room = (
        LONGEST_PROGRAM_LINE
        - len(f"PR ,{sign(state).item}")
        - (len(state.address) if mode.party else 0)
        - bool(mode.checksum)
    )
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
        alone = before is None or (form_of(before) is SettingForm.DIGIT and form is SettingForm.DIGIT)
        items += ("" if before is None else "," if alone else f',"{VALUE_SEPARATOR}",') + row.name
        forms.append(f"{'' if alone else VALUE_SEPARATOR}{form.value}")
    return items, forms


def _print(state: MCodeState, items: str, forms: Sequence[str]) -> Procedure[list[str] | None]:
    """Print values; None where the drive refuses to, or prints what is not understood. Raises NoAnswer."""
    answer = "".join(f"(?:{form})" for form in forms)
    for _ in range(1 + QUESTION_REPEATS):
        yield from before_request(state, question(state, items, answer))
        reply = yield from send_once(state, question(state, items, answer))
        if reply.end is End.DONE:
            note_error(state, reply)
            match = re.fullmatch("".join(f"({form})" for form in forms), value(state, reply))
            assert match is not None
            return [group.removeprefix(VALUE_SEPARATOR).strip() for group in match.groups()]
        if reply.end is End.REFUSED and not reply.doubtful:
            state.error_flag_read(True)
            return None
        if reply.end is not End.NAK:
            state.reply_lost()
    if reply.end is not End.TIMEOUT:
        return None
    raise NoAnswer(f"{who(state)} does not reply as expected: its settings were not read ({reply.end.value})")


def _value(form: SettingForm, text: str) -> Value:
    if form in (SettingForm.DIGIT, SettingForm.WHOLE):
        return int(text)
    if form is SettingForm.FRACTION:
        return float(text)
    fields = [part.strip() for part in text.split(",")]
    numbers = tuple(int(field) if re.fullmatch(r"-?\d+", field) else field for field in fields)
    return numbers if len(numbers) > 1 else numbers[0]


def _numbered(state: MCodeState, word: str, numbers: Sequence[int]) -> Procedure[tuple[str, ...]]:
    """Print a list of known length, which ends with its last number; where that does not come, with a mark.

    Drives without an encoder may print its index mark, input 6, all the same.
    """
    if numbers[-1] != LISTS[word][-1]:
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
    flag_may_be_set = state.error
    for _ in range(1 + QUESTION_REPEATS):
        yield from before_request(state, question(state, "EF", "[01]"))
        reply = yield from send_once(state, state.codec.request(state.address, text))
        if reply.end in (End.REFUSED, End.NAK) or reply.prompt == "?":  # noise may have made another line of it
            state.error_possible()
        lines = reply.lines
        if state.codec.em != 0 or reply.end is not End.DONE:
            rest = yield from rest_of_list(state, Priority.OPERATOR)
            if rest is None or lacks_lines(reply, lines):
                flag_may_be_set = True
                continue
            state.synchronised()
            lines += rest
        whole = reply.end in (End.DONE, End.SILENT)
        if reply.end in (End.REFUSED, End.NAK):  # an earlier error looks like the refusal of an empty list
            whole = flag_may_be_set or (reply.end is End.NAK and bool(reply.lines))
        if whole:
            return tuple(line for line in lines if line)
    raise NoAnswer(f"{who(state)}: the list of '{text}' may be incomplete ({reply.end.value}); ask again")


class MCodeParameters(LexiumParameters):
    """The settings of an MCode drive."""

    state: MCodeState

    later = frozenset({"BD"})

    def read(self, progress: Progress) -> Procedure[Readings]:
        """Read every setting that the drive prints. Raises Refused where it would store the questions, or NoAnswer."""
        state = self.state
        if state.address in EVERY_DRIVE:
            raise Refused(f"'{state.address}' is every drive; name one")
        refuse_in_program(state)
        flag = yield from _print(state, "EF", [SettingForm.DIGIT.value])
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

    def ready(self) -> Procedure[str]:
        """Return the reason for which settings must not change now; empty: there is none."""
        state = self.state
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

    def save(self) -> Procedure[None]:
        state = self.state
        if state.programming:
            raise Refused(f"{who(state)} is in program mode and would store S: PG ends that")
        yield from MCodeOperations(state).perform("S")

    def conflict(self, plan: Plan, others: Collection[str]) -> str:
        """Return the reason for which a name or party mode would disturb other drives of the line; empty: none."""
        final = {change.name: change.after for change in plan}
        if final.get("DN") in others:
            return f"another drive of the line is named {final['DN']}"
        return (
            "other drives share the line, and PY=0 would make this one reply to all of it"
            if (others and final.get("PY") == 0)
            else ""
        )
