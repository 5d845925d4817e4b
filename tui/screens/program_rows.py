"""The rows around the editor of a program, and the choices of its page: a file, a way to download, a way to run."""

from __future__ import annotations

import os
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import NamedTuple

from rich.text import Text

from multidrop.base.text import counted
from multidrop.dialects.debugging import Debugging
from multidrop.dialects.families import program_languages
from multidrop.dialects.program_files import LinePart, Problem, ProgramEntry, errors, in_order
from multidrop.shell.line_syntax import join_target
from multidrop.shell.programs.edited_file import real_text
from multidrop.shell.programs.program_text import ProgramGrammar
from multidrop.shell.session import Session
from multidrop.tui.editor import Grammar, MacroGrammar, Mark
from multidrop.tui.panels.view import Glance, name_of
from multidrop.tui.readout import ProgramFacts
from multidrop.tui.screen_model import Record
from multidrop.tui.screens.dialogs import Match
from multidrop.tui.text import fit, visible
from multidrop.tui.texts import OpenText
from multidrop.tui.widgets.lines import Row, Span, spread, width_of
from multidrop.tui.widgets.transcript import MARKS

MOST_PROBLEMS = 4
"""Problems that are shown below the editor."""


@dataclass(frozen=True)
class Findings:
    """The findings of the last check of a text."""

    problems: tuple[Problem, ...] = ()
    addresses: tuple[tuple[int, int], ...] = ()
    """The address of a line in the drive, and the line of the text from 0; empty unless both hold one program."""
    entries: tuple[ProgramEntry, ...] = ()
    """The places at which a program can begin."""
    pending: bool = False
    """The text was edited since."""

    @property
    def words(self) -> Span:
        wrong = len(errors(self.problems))
        warned = len(self.problems) - wrong
        if self.pending:
            return "checking … ", "dim"
        if wrong:
            return f"✗ {counted(wrong, 'error')} ", "error"
        if warned:
            return f"! {counted(warned, 'warning')} ", "strong"
        return "✓ no error ", "text"


def heading_row(
    text: OpenText | None, title: str, findings: Findings, target: Glance | None, width: int, outside: str = ""
) -> Row:
    """The file, whether it is saved, the result of the check, and the drive that it is for.

    `outside`: what another program did to the file.
    """
    if text is None:
        return ((" PROGRAM   ", "strong"), ("no file: ^E opens one", "dim"))
    state = "new, not saved" if text.file.new else "changed, not saved" if text.changed else "saved"
    told = outside.partition(":")[0]
    if told:
        state = f"not saved; file {told}" if text.changed else f"the file {told}"
    unsaved = text.changed or text.file.new or bool(told)
    where = f"for {name_of(target)} ({target.product}) " if target is not None else "no drive selected "
    left: list[Span] = [
        (" PROGRAM  ", "strong"),
        (f" {visible(text.name)} ", "accent"),
        (f" {title} ", "dim"),
        (f" {'● ' if unsaved else ''}{state} ", "motion" if text.changed or told else "dim"),
        (" ", "text"),
    ]
    if text.text.strip():
        left.append(findings.words)
    return spread(left, [(where, "dim")], width)


def problem_rows(problems: Sequence[Problem], at: int, width: int, most: int = MOST_PROBLEMS) -> list[Row]:
    """The problems from the line of the cursor on (from 1), then from the top; errors before warnings; `most` rows."""
    ahead = sorted(problems, key=lambda each: (each.warning, each.line < at))
    rows: list[Row] = []
    for problem in ahead[:most]:
        hint = f"; {problem.hint}" if problem.hint else ""
        sign, role = ("!", "strong") if problem.warning else ("✗", "error")
        place = f"{problem.line}:{problem.column}"
        rows.append(
            ((f" {sign} ", role), (f"{place:<7} ", "dim"), (fit(visible(problem.what + hint), width - 12), "text"))
        )
    if len(problems) > most:
        rows[-1] = ((fit(f"   … and {len(problems) - most + 1} more; ^F goes from one to the next", width), "dim"),)
    return rows


def news_rows(records: Sequence[Record], wall: Callable[[float], datetime], width: int) -> list[Row]:
    """The last lines of the transcript, a row each, with the time of day."""
    rows: list[Row] = []
    for record in records:
        sign, role = MARKS[record.mark]
        head = f" {wall(record.at):%H:%M:%S} "
        rows.append(
            (
                (head, "dim"),
                (f"{fit(record.address, 3)} ", "dim"),
                (f"{sign} ", role),
                (fit(visible(record.text), width - len(head) - 6), "error" if record.mark == "x" else "text"),
            )
        )
    return rows


def rule(title: str, width: int, right: str = "") -> Row:
    """A rule with a title in it, and what goes on at its right end."""
    left: list[Span] = [("─", "rule"), (f" {title} ", "strong")]
    end: list[Span] = [(f" {right} ", "motion"), ("─", "rule")] if right else []
    return (*left, ("─" * max(0, width - width_of(left) - width_of(end)), "rule"), *end)


def marks_of(problems: Sequence[Problem], break_line: int | None, current: tuple[int, str] | None) -> dict[int, Mark]:
    """The signs of lines, from 0: the current line precedes errors, a break point and warnings."""
    marks: dict[int, Mark] = {}
    for problem in problems:
        if problem.line - 1 not in marks or not problem.warning:
            marks[problem.line - 1] = Mark("!", "warning") if problem.warning else Mark("✗", "error")
    if break_line is not None and marks.get(break_line, Mark("!", "warning")).role == "warning":
        marks[break_line] = Mark("●", "break")
    if current is not None:
        marks[current[0]] = Mark(current[1], "starts")
    return marks


UPLOAD = "\0upload"
"""The choice to read what the drive holds into a new file."""
MOST_FILES = 200


class Choice(NamedTuple):
    """The effect, and the line that has it."""

    title: str
    line: str


def target_of(session: Session) -> str:
    """The selected drive as typed lines name it; empty where no other one can be meant."""
    if session.selected is None:
        return ""
    return join_target(session.selected_bus if len(session.buses) > 1 else "", session.selected.address)


def with_target(verb: str, target: str, *words: str) -> str:
    return " ".join(word for word in (verb, target, *words) if word)


# Files


class FoundFile(NamedTuple):
    """A program file."""

    name: str
    about: str


def files_in(folder: str) -> list[FoundFile]:
    """The program files in a folder, the newest first, then its folders; empty for the current one."""
    endings = {ending for files in program_languages().values() for ending in files.endings}
    files: list[tuple[float, FoundFile]] = []
    folders: list[FoundFile] = []
    try:
        for entry in os.scandir(folder or "."):
            if entry.is_dir() and not entry.name.startswith("."):
                folders.append(FoundFile(f"{folder}{entry.name}/", "folder"))
            elif os.path.splitext(entry.name)[1].lower() in endings and entry.is_file():
                state = entry.stat()
                about = f"{state.st_size} B   {datetime.fromtimestamp(state.st_mtime):%Y-%m-%d %H:%M}"
                files.append((state.st_mtime, FoundFile(f"{folder}{entry.name}", about)))
    except OSError:
        return []
    up = [FoundFile(f"{folder}../", "the folder above")]
    return [*(file for _, file in sorted(files, reverse=True)), *sorted(folders), *up][:MOST_FILES]


class Finder:
    """Finds the files whose names contain a typed text. `here`: those of the folder `base`; empty: the current one."""

    def __init__(self, here: Sequence[FoundFile], unsaved: Sequence[OpenText], drive: str, base: str = "") -> None:
        self._folders = {base: list(here)}
        self._unsaved, self._drive, self._base = unsaved, drive, base

    def __call__(self, typed: str) -> list[Match]:
        """Texts that are not saved, then files, then what the drive holds; and the text as a name of its own."""
        wanted = typed.strip()
        wanted = wanted if os.path.isabs(wanted) else self._base + wanted
        folder = wanted[: wanted.rfind("/") + 1]
        if folder not in self._folders:
            self._folders[folder] = files_in(folder)
        named = {text.name: "not saved" for text in self._unsaved}
        named |= {file.name: file.about for file in self._folders[folder] if file.name not in named}
        matches = [_match(name, about) for name, about in named.items() if wanted.casefold() in name.casefold()]
        if self._drive and not wanted:
            program = Text.assemble(f"{f'the program in {self._drive}':<28}  ", ("/upload into a new file", "dim"))
            files = [n for n, match in enumerate(matches) if not match.key.endswith("/")]
            matches.insert(len(files), Match(UPLOAD, program))
        if wanted and wanted not in named and not wanted.endswith("/"):
            own = _match(wanted, "open it, or begin it as a new file")
            matches.insert(0 if "." in wanted[len(folder) :] else len(matches), own)
        return matches


def _match(name: str, about: str) -> Match:
    return Match(name, Text.assemble(f"{visible(name):<28}  ", (about, "dim")))


# Download


def download_choices(text: OpenText, target: str, again: bool) -> list[Choice]:
    """Return the answers to the question before a download; the first one sends nothing.

    `again`: the text on the screen has just been read again.
    """
    file = shlex.quote(text.name)
    first = "Save the file and send it" if text.changed or text.file.new else "Send it"
    return [
        Choice("Cancel, and look at the new text" if again else "Cancel, send nothing", ""),
        Choice(first, with_target("/download", file, target)),
        Choice(f"{first}; keep it at power-off", with_target("/download", file, target, "--save")),
        Choice(f"{first}, only if it differs", with_target("/download", file, target, "--only-changed")),
    ]


def download_trouble(text: OpenText, findings: Findings) -> str:
    """Return why a text would not be downloaded, in one line; empty: it would."""
    wrong = len(errors(findings.problems))
    if not wrong:
        return ""
    return f"{visible(text.name)} has {counted(wrong, 'error')}, so nothing is sent; ^F goes to the next error"


def download_facts(program: ProgramFacts, outside: str = "", again: str = "") -> list[str]:
    """Return the facts before a download: what becomes of the program in the drive, and what other programs did.

    `again`: where the text that was read again just now is new. `outside`: what became of the file, while its text
    stays on the screen.
    """
    lines = [f"! The file has changed on the disk and was read again. {again}."] if again else []
    if outside:
        lines.append(f"! The file {outside}; the text on the screen is sent.")
    if program.line is not None:
        lines.append("its program runs: it is ended first")
    return [*lines, "What the drive holds is read and saved to a backup first, then replaced."]


# Run


def run_choices(
    entries: Sequence[ProgramEntry], target: str, program: ProgramFacts, debugging: Debugging | None
) -> list[Choice]:
    """Return the ways to run a program, and what else can be done while one runs or waits.

    What the drive would refuse is left out; `debugging` is what observes its programs, None: nothing does.
    """
    start = f"@{target} " if target else ""
    steps = debugging is not None and not debugging.cannot_step
    choices: list[Choice] = []
    if program.line is not None and steps:
        choices.append(Choice("Go on at normal speed", with_target("/continue", target)))
    if program.line is not None and debugging is not None and steps and not debugging.no_break:
        choices.append(Choice("Break it where it is", with_target("/break", target, "now")))
    ways = [("", "Run from")]
    ways += [("/trace", "Trace from")] if debugging is not None else []
    ways += [("/step", "Step by step from")] if steps else []
    for verb, what in ways:
        for entry in entries:
            line = with_target(verb, target, entry.name) if verb else f"{start}{entry.start}"
            choices.append(Choice(f"{what} {entry.name}", line))
    if program.break_point:
        choices.append(Choice(f"Remove the break point {program.break_point}", with_target("/break", target, "off")))
    return [*choices, Choice("List what the drive holds", with_target("/list", target))]


# The lines of a file and those in a drive: which line of the file has which address, where both hold one program.


Parts = Callable[[str], Sequence[LinePart]]


def aligned(text: str, rows: Sequence[tuple[int, str]], parts: Parts) -> Mapping[int, int]:
    """Return the line of the file, from 0, by address; empty unless the lines of the drive are there once, in a row."""
    file = [(number, bare) for number, line in enumerate(text.split("\n")) if (bare := _bare(line, parts))]
    held = [_bare(line, parts) for _, line in rows]
    size = len(held)
    places = [at for at in range(len(file) - size + 1) if size and [bare for _, bare in file[at : at + size]] == held]
    if len(places) != 1:
        return {}
    return {address: number for (address, _), (number, _) in zip(rows, file[places[0] :], strict=False)}


def _bare(line: str, parts: Parts) -> str:
    """A line without its remark and its blanks, in capitals; `=` is a blank in most places."""
    end = next((part.start for part in parts(line) if part.kind == "remark"), len(line))
    return "".join(line[:end].upper().replace("=", " ").split())


Unit = tuple[str, str, str]
"""What a drive says of itself: product, version and part number."""


def unit_of(session: Session) -> Unit:
    """Return what the selected drive says of itself; nothing without one."""
    state = session.selected.state if session.selected is not None else None
    return (state.product, state.version, state.part) if state is not None else ("", "", "")


def refusal(grammar: Grammar | None, text: OpenText) -> str:
    """Say why a macro that is wrong is not saved; empty: it is saved. The old macro stays, and the text."""
    if not isinstance(grammar, MacroGrammar) or not (problems := grammar.check(real_text(text.text), "")):
        return ""
    return f"{problems[0].line_for(text.name)}; not saved: the macro is as it was, and this text stays"


def examined(grammar: Grammar, text: str, unit: Unit, lines: tuple[tuple[int, str], ...]) -> Findings:
    """Check a text for a drive, and compare it with the lines that it holds. For a thread."""
    problems = list(grammar.check(real_text(text), unit[0]))
    if isinstance(grammar, ProgramGrammar):
        problems = in_order([*problems, *grammar.files.unsupported(real_text(text), *unit)])
    addresses = tuple(aligned(text, lines, grammar.parts).items())
    return Findings(tuple(problems), addresses, tuple(grammar.entries(text)))
