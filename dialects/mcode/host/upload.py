"""The program of an MCode drive as a file, with the remarks of the file that it came from."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from multidrop.dialects.codec import Procedure
from multidrop.dialects.files import split_lines
from multidrop.dialects.held import Held
from multidrop.dialects.mcode.host.holding import read
from multidrop.dialects.mcode.host.listing import GLOBAL, declared, names_of, programs
from multidrop.dialects.mcode.host.state import MCodeState
from multidrop.dialects.mcode.host.wording import who
from multidrop.dialects.mcode.manual import program_file


def upload(state: MCodeState, raw: bool) -> Procedure[tuple[str, ...]]:
    """Return a file that reproduces a drive's program and variables: VA, PG, the lines, PG, S."""
    held = yield from read(state, (), lambda done, total: None)
    held.check_program(who(state))
    return file_of(state, held, raw)


def file_of(state: MCodeState, held: Held, raw: bool) -> tuple[str, ...]:  # noqa: ARG001
    """Return the lines of a file that reproduces what a drive holds; none where that is nothing."""
    made = [f"VA {name}={called.value}" for name, called in names_of(held).items() if called.kind == GLOBAL]
    for program in programs(held.lines, state.product, fine=True):
        made += [f"PG {program.start}", *(line.text for line in program.lines), "PG"]
    return (*made, "S") if made else ()


def readable(held: Held) -> tuple[str, ...]:
    """List the program as the drive does."""
    return tuple(f"{line.at}  {line.text}" for line in held.lines)


def refreshed(text: str, held: Held) -> tuple[str, ...]:
    """Return a file's lines with the present values of the variables that it declares, and those that it lacks."""
    missing = {name: called.value for name, called in names_of(held).items() if called.kind == GLOBAL}
    made: list[str] = []
    at: int | None = None
    for line, sent in _lines(text):
        if sent is not None and sent.section == "program":
            at = len(made) if at is None else at
        elif sent is not None and (found := declared(sent.text)) is not None and found[1] in missing:
            line = _with_value(line, sent.text, found[1], missing.pop(found[1]))
        made.append(line)
    more = [f"VA {name}={value}" for name, value in missing.items()]
    return (*made[:at], *more, *made[at:]) if at is not None else (*made, *more)


def _with_value(line: str, sent: str, name: str, value: str) -> str:
    """Write the value of a declaration; the line stays as it is where the value is the same."""
    same = (sent.partition("=")[2].strip() or "0") == value
    return line if same else line.replace(sent, f"VA {name}={value}", 1)


def annotated(text: str, held: Held) -> tuple[str, ...]:
    """Return a listing with the remarks and the layout of the file that it came from."""
    addresses = iter(held.lines)
    width = max((len(str(line.at)) for line in held.lines), default=0)
    made: list[str] = []
    rest: list[str] = []
    for line, sent in _lines(text):
        if sent is None:
            rest.append(f"{'':{width}}  {line}".rstrip())
        elif sent.section == "program" and sent.mark is None:
            at = next(addresses).at
            made += [*(rest if made else []), f"{at:<{width}}  {line}"]
            rest = []
        else:
            rest = []
    return tuple(made)


def _lines(text: str) -> Iterator[tuple[str, program_file.ProgramLine | None]]:
    """Yield each line of a file, with what of it is sent."""
    sent: Sequence[program_file.ProgramLine] = program_file.scan(text)[0]
    by_number = {line.number: line for line in sent}
    for number, line in enumerate(split_lines(text.removesuffix("\x1a").removesuffix("\n")), 1):
        yield line, by_number.get(number)
