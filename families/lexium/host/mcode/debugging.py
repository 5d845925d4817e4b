"""Programs of an MCode drive under observation: EX modes 1 and 2, BP, the keys of single step.

Theory of operation. `EX LABEL,1` prints each line before its execution. `EX LABEL,2` waits for a key before each line
(`step_key`). A traced program that comes to the break point goes over to single step and prints nothing more. Nothing
in a drive can be asked whether it waits for a key. So the host counts as evidence only: `EX LABEL,2` that was accepted
and after which a program runs; `BP` without a place, accepted likewise; a line that a key has just shown; a trace that
has become quiet before the break point, with no hold under way. A stop, a restart, and any line that acts on the
program end that (`MCodeState.stepping`). The manual does not say how a drive takes keys in party mode or with a
checksum: there the host starts no single step. (MCode reference 5.1.13, 5.1.42; decision 0031.)
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from multidrop.base.errors import Diagnostic, Inexpressible, NoAnswer, Refused
from multidrop.dialects.codec import Decoded, End, Kind, Procedure, Reply, Request
from multidrop.dialects.debugging import Debugging, Look, Neighbours, Stepped
from multidrop.dialects.program_files import Stored
from multidrop.dialects.state import who
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.lexium.host.mcode.exchange import printed_value
from multidrop.families.lexium.host.mcode.framing import printable
from multidrop.families.lexium.host.mcode.operations import MCodeOperations
from multidrop.families.lexium.host.mcode.state import MCodeState
from multidrop.families.lexium.manual.grammar import NameTerm, Number, parsed
from multidrop.families.lexium.manual.mnemonic import MDRIVE_PLUS
from multidrop.families.lexium.manual.table import lookup

# The keys of single step: one byte each, outside of any line.
#
# Theory of operation. In EX mode 2, and after a break point, a drive waits before each line of its program for a key:
# space executes that line, Enter runs on at normal speed (MCode reference 5.1.42). A key has no name, no terminator
# and no checksum. The only sign of a step is the line that the drive prints: its address, two blanks, its text. A
# blank that comes back alone is an echo: the drive took the key as the first character of a command, so it does not
# step. The host never sends a key twice: after a lost line it is not known whether the drive stepped.


SPACE, ENTER = b" ", b"\r"
STEP, RUN_ON = "single step", "run on"
SETTLE = 0.05
"""The quiet time after Enter, to which a drive gives no reply, s."""
LONGEST_SETTLE = 0.3
TRACED = re.compile(r"[>? ]*(\d{1,6})  (\S[ -~\t]*)[\x80-\xff]?")
"""A line as trace and single step print it; a prompt or an echo may precede it, a check byte may follow."""


@dataclass(frozen=True)
class StepKey(MCode):
    """The codec of one key for a drive with these settings."""

    def decode(self, request: Request, buffer: bytes) -> Decoded | None:
        """Find the line that a step printed; a program's prints before it are strays."""
        if request.body != SPACE:
            return None
        used = 0
        strays: list[str] = []
        for raw in buffer.split(b"\n")[:-1]:
            used += len(raw) + 1
            text = printable(raw)
            if TRACED.fullmatch(text):
                return Decoded(Reply((text.lstrip(">? "),), acknowledged=True), used, tuple(strays))
            strays.append(text)
        return None

    def on_quiet(self, request: Request, buffer: bytes) -> Decoded | None:
        """End the wait after Enter; a step waits for its line."""
        return self._settled(buffer) if request.body == ENTER else None

    def on_timeout(self, request: Request, buffer: bytes) -> Decoded:
        """Return REFUSED where the key only came back, TIMEOUT where its line is missing."""
        if request.body == ENTER:
            return self._settled(buffer)
        if buffer == SPACE:
            return Decoded(Reply(end=End.REFUSED), len(buffer))
        lines, used = self.parse_unsolicited(buffer)
        return Decoded(Reply(end=End.TIMEOUT), used, lines)

    def _settled(self, buffer: bytes) -> Decoded:
        lines, used = self.parse_unsolicited(buffer)
        return Decoded(Reply(), used, lines)


def key(state: MCodeState, data: bytes) -> Request:
    codec = state.codec
    own = StepKey(codec.em, codec.party, codec.checksum, codec.escape)
    step = data == SPACE
    request = Request(state.address, STEP if step else RUN_ON, Kind.COMMAND, own, body=data)
    return request if step else replace(request, settle=SETTLE, timeout=LONGEST_SETTLE)


PLACE = re.compile(r"[A-Z][A-Z0-9]{0,2}|\d{1,5}", re.IGNORECASE | re.ASCII)
_LISTED = re.compile(r"\s*(\d+)\s+(\S.*)")
_USER = re.compile(r"\s*(\w+)\s*=\s*[GL]\s+(\S+)\s*")
"""A variable in the print of PR UV."""
JUMPS = ("BR", "CL")
FIRST_ADDRESS = "1"
BEGIN = "/step LABEL begins single step, /break now breaks a program that runs"


def _waits_now(state: MCodeState) -> Procedure[None]:
    """Record that the drive waits for a key, after a line that leads there was accepted."""
    if not (yield from MCodeOperations(state).flag("BY")):
        raise Refused(f"{who(state)}: no program runs; there is nothing to step through")
    state.steps()


def _checked(place: str) -> str:
    if not PLACE.fullmatch(place):
        raise Diagnostic(f"no place {place}", "", "valid: a label, or an address of the listing")
    return place


def _no_keys(state: MCodeState) -> str:
    """Return why no key of single step is sent, where the manual does not say how the drive takes it; empty: it is."""
    if not state.codec.party and not state.codec.checksum:
        return ""
    mode = "in party mode" if state.codec.party else "with a checksum"
    return f"single step needs bare keys, and the manual does not say how a drive takes them {mode}"


def _check_keys(state: MCodeState) -> None:
    """Raise Inexpressible where the manual does not say how the drive takes a key."""
    if reason := _no_keys(state):
        raise Inexpressible(f"{who(state)}: {reason}; nothing was sent; set PY=0 and CK=0, or trace it")


def _check_steps(state: MCodeState) -> None:
    """Raise unless it is known that the drive waits, and a key can be sent."""
    _check_keys(state)
    if not state.stepping:
        raise Refused(f"{who(state)}: it is not known that it waits for a key, so none was sent; {BEGIN}")


def _places(program: Sequence[Stored]) -> Mapping[str, int]:
    """The addresses by label, and by themselves."""
    places = {str(row.at): row.at for row in program}
    for row in program:
        statement = parsed(row.text)
        if statement is not None and statement.word == "LB" and statement.arguments:
            label = statement.arguments[0]
            if isinstance(label, NameTerm):
                places[label.word] = row.at
    return places


def _code_at(program: Sequence[Stored], address: int) -> int | None:
    """The address of the first line from there on that is not a label."""
    if address < 0:
        return None
    return next((row.at for row in program if row.at >= address and not _is(row.text, "LB")), None)


def _is(text: str, word: str) -> bool:
    statement = parsed(text)
    return statement is not None and statement.word == word


def _settled(state: MCodeState) -> Procedure[bool]:
    """Whether an H for motion is over: it waits for MV=0, then MT; MP=0 comes later still (5.1.50)."""
    said = yield from printed_value(state, 'MV," ",MP," ",MT', r"[01] [01] \d{1,5}")
    moving, positioning, settling = said.split()
    return moving == "0" and "0" in (positioning, settling)


class MCodeDebugging(Debugging):
    """Observes the program of an MCode drive."""

    state: MCodeState

    @property
    def cannot_step(self) -> str:
        """The reason why no key of single step is sent to it with its present settings; empty: one is."""
        return _no_keys(self.state)

    def listing(self) -> Procedure[tuple[Stored, ...]]:
        """Read the program in the drive. LK is read first: a refusal would run an OE subroutine."""
        state = self.state
        if (yield from MCodeOperations(state).flag("LK")):
            raise Refused(f"{who(state)}: its program is locked (LK=1), so it is neither listed, traced nor stepped")
        lines = yield from MCodeOperations(state).listing("")
        matches = [match for line in lines if (match := _LISTED.fullmatch(line))]
        return tuple(Stored(int(each[1]), each[2]) for each in matches)

    def entry(self, rows: Sequence[Stored]) -> str:
        """Return SU where the program has it, else the first address."""
        return "SU" if _places(rows).get("SU") else FIRST_ADDRESS

    def address(self, rows: Sequence[Stored], place: str) -> int | None:
        """Return the address of the first line at a place that is not a label."""
        return _code_at(rows, _places(rows).get(place.upper(), -1))

    def idle(self, place: str, neighbours: Neighbours | None) -> Procedure[None]:
        """Raise Refused while a program runs, which EX would leave where it is.

        A traced line begins with its address. On a party line a drive whose name is a digit may take it for a command.
        """
        state = self.state
        _checked(place)
        if neighbours is None:
            _check_keys(state)
        runs = yield from MCodeOperations(state).flag("BY")  # which may find other settings
        if neighbours is None:
            _check_keys(state)
        elif state.codec.party and (digits := [neighbour for neighbour in neighbours if neighbour.isdigit()]):
            raise Refused(
                f"{who(state)}: a traced line begins with a number, and drive {digits[0]} on this line may take it for "
                "a command; not started"
            )
        if runs:
            raise Refused(f"{who(state)}: a program runs already; not started; E ends it")

    def trace(self, place: str) -> Procedure[None]:
        yield from MCodeOperations(self.state).perform(f"EX {_checked(place)},1")

    def begin(self, place: str) -> Procedure[None]:
        """Start a program in EX mode 2. With a break point it would run up to that unseen, so that is removed."""
        state = self.state
        yield from MCodeOperations(state).perform("BP=0")
        yield from MCodeOperations(state).perform(f"EX {_checked(place)},2")
        yield from _waits_now(state)

    def waits(self, place: str, last: Stored | None) -> Procedure[None]:
        """Raise Refused unless the drive is known to wait for a key now. `last`: an H may still hold for motion."""
        state = self.state
        _check_keys(state)
        if state.stepping and not (yield from MCodeOperations(state).flag("BY")):
            state.steps(False)
            raise Refused(f"{who(state)}: its program has ended; no key was sent; {BEGIN}")
        _check_steps(state)
        if last is not None and self._holds_for_motion(last.text) and not (yield from _settled(state)):
            raise Refused(
                f"{who(state)}: '{last.text}' waits for the end of the motion; no key was sent; step again later"
            )

    def forget(self) -> None:
        self.state.steps(False)

    def step(self, rows: Sequence[Stored]) -> Procedure[Stepped]:
        """Press the space bar once; return the line that it executed. Raises NoAnswer where that is not known."""
        state = self.state
        _check_steps(state)
        state.steps(False)
        reply = yield key(state, SPACE)
        if reply.end is End.REFUSED:
            raise Refused(f"{who(state)} takes the space bar as text, so it does not step; nothing was executed")
        row = self.traced(reply.text) if reply.end is End.DONE and not reply.doubtful else None
        if row is None or (rows and row not in rows):
            state.reply_lost()
            why = "may be a late reply" if reply.doubtful else "is not a line of its program"
            came = f"'{reply.text}' came, which {why}" if reply.text else "no line came"
            raise NoAnswer(f"{who(state)}: {came}: it is not known whether it stepped; the key was sent once")
        state.steps()
        return Stepped(row, (yield from self._hold(row.text)))

    def go_on(self, place: str) -> Procedure[None]:
        state = self.state
        _check_steps(state)
        state.steps(False)
        yield key(state, ENTER)

    def look(self, place: str = "") -> Procedure[Look]:
        """Read whether a program runs; an MCode drive does not report where."""
        state = self.state
        runs = yield from MCodeOperations(state).flag("BY")
        if not runs:
            state.steps(False)
        return Look(runs, state.stepping)

    def break_at(self, place: str, passes: int) -> Procedure[None]:
        """Set the break point. It is refused where no key could be sent to a program that waits there."""
        _check_keys(self.state)
        yield from MCodeOperations(self.state).perform(f"BP {_checked(place)},{passes}")

    def break_off(self) -> Procedure[None]:
        yield from MCodeOperations(self.state).perform("BP=0")

    def break_now(self, place: str = "") -> Procedure[None]:
        """Have a running program wait for keys from here on."""
        state = self.state
        if state.product in MDRIVE_PLUS:
            raise Inexpressible(f"{who(state)}: an {state.product} takes BP with a place only; nothing was sent")
        _check_keys(state)
        if not (yield from MCodeOperations(state).flag("BY")):
            raise Refused(f"{who(state)}: no program runs; nothing was sent")
        _check_keys(state)
        yield from MCodeOperations(state).perform("BP")
        yield from _waits_now(state)

    def broken(self, rows: Sequence[Stored], last: Stored, place: str) -> Procedure[int | None]:
        """Whether the drive waits at the break point: the trace was quiet longer than `last` holds its program."""
        state = self.state
        if not self.may_follow(rows, last, place):
            return None
        if not (yield from MCodeOperations(state).flag("BY")):
            return None
        if self._holds_for_motion(last.text) and not (yield from _settled(state)):
            return None
        state.steps()
        return self.address(rows, place)

    def hold(self, text: str) -> float | None:
        """Seconds for which a line holds its program; 0 where it holds for motion or not at all."""
        statement = parsed(text)
        if statement is None or statement.word != "H" or not statement.arguments:
            return 0.0
        argument = statement.arguments[0]
        return float(argument.value) / 1000 if isinstance(argument, Number) else None

    def names(self, names: Sequence[str]) -> None:
        """Check names to watch: a word that prints one value and clears nothing, or the form of a user's name."""
        for name in names:
            row = lookup(name.upper(), self.state.product)
            readable = (
                row is not None and row.kind in ("variable", "flag") and row.access in ("RW", "RO") and not row.lines
            )
            if not (readable or (row is None and PLACE.fullmatch(name) and not name.isdigit())):
                why = "reading it clears it" if row is not None and row.access == "RC" else "it prints no value"
                raise Diagnostic(f"{name} cannot be watched: {why}", "", "valid: a variable, a flag, or a name with VA")

    def values(self, names: Sequence[str]) -> Procedure[Mapping[str, str]]:
        """Read variables. User variables come from PR UV: to ask for one that is not there would be an error."""
        state = self.state
        values: dict[str, str] = {}
        users = [name for name in names if lookup(name, state.product) is None]
        listed = (yield from MCodeOperations(state).perform("PR UV")) if users else ()
        declared = {match[1].upper(): match[2] for line in listed if (match := _USER.fullmatch(line))}
        for name in names:
            if name in users:
                values.update({name: declared[name]} if name in declared else {})
            else:
                values[name] = " ".join((yield from MCodeOperations(state).perform(f"PR {name}")))
        return values

    def traced(self, line: str) -> Stored | None:
        """Return the executed line that a printed line shows."""
        match = TRACED.fullmatch(line)
        return Stored(int(match[1]), match[2]) if match else None

    def _hold(self, text: str) -> Procedure[float | None]:
        """Seconds for which a line holds; a variable is read."""
        if (seconds := self.hold(text)) is not None:
            return seconds
        statement = parsed(text)
        argument = statement.arguments[0] if statement is not None else None
        read = (yield from self.values([argument.word])) if isinstance(argument, NameTerm) else {}
        figure = "".join(read.values())
        return int(figure) / 1000 if figure.isdecimal() else None

    def may_follow(self, program: Sequence[Stored], last: Stored, place: str) -> bool:
        """Whether the line at `place` can be the next one after `last`."""
        wanted = self.address(program, place)
        statement = parsed(last.text)
        if wanted is None or statement is None or statement.word in ("E", "LK"):  # a lock ends the trace
            return False
        if statement.word == "RT":  # a trip's may return to a hold
            return not any(_is(row.text, "H") for row in program)
        following = [_code_at(program, last.at + 1)]
        if statement.word in JUMPS and statement.arguments:
            target = statement.arguments[0]
            name = str(int(target.value)) if isinstance(target, Number) else getattr(target, "word", "")
            following.append(self.address(program, name))
        return wanted in following

    def _holds_for_motion(self, text: str) -> bool:
        return _is(text, "H") and self.hold(text) == 0
