"""What a person can choose on the program page: a file, a way to download, a way to run. Each shows its line."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

from rich.text import Text

from dialects.families import program_languages
from dialects.problems import errors
from dialects.program_files import Entry
from shell.lines import join_target
from tui.editor.texts import OpenText
from tui.screen_model import ProgramFacts
from tui.screens.dialogs import Match
from tui.screens.program_rows import Findings
from tui.session_view import SessionView
from tui.text import visible

UPLOAD = "\0upload"
"""The choice to read what the drive holds into a new file."""
MOST_FILES = 200


class Choice(NamedTuple):
    """What it does, and the line that does it."""

    title: str
    line: str


def target_of(session: SessionView) -> str:
    """The selected drive as typed lines name it; empty where no other one can be meant."""
    if session.selected is None:
        return ""
    return join_target(session.selected_bus if len(session.buses) > 1 else "", session.selected.address)


def with_target(verb: str, target: str, *words: str) -> str:
    """A line of a verb for a drive."""
    return " ".join(each for each in (verb, target, *words) if each)


def quoted(file: str) -> str:
    """A file as a word of a typed line."""
    return shlex.quote(file)


# Files


class Found(NamedTuple):
    """A program file in the current folder."""

    name: str
    about: str


def files_here() -> list[Found]:
    """The program files in the current folder, the newest first. For a thread."""
    endings = {ending for files in program_languages().values() for ending in files.endings}
    found: list[tuple[float, Found]] = []
    try:
        paths = [path for path in Path.cwd().iterdir() if path.suffix.lower() in endings and path.is_file()]
        for path in paths:
            state = path.stat()
            about = f"{state.st_size:,} B   {datetime.fromtimestamp(state.st_mtime):%Y-%m-%d %H:%M}"
            found.append((state.st_mtime, Found(path.name, about)))
    except OSError:
        return []
    return [each for _, each in sorted(found, reverse=True)][:MOST_FILES]


def files_like(found: Sequence[Found], unsaved: Sequence[OpenText], drive: str, typed: str) -> list[Match]:
    """The texts that are not saved and the files whose names contain the text, and the text as a name of its own."""
    wanted = typed.strip()
    named = {text.name: "not saved" for text in unsaved} | {each.name: each.about for each in found}
    matches = [
        Match(name, Text.assemble(f"{visible(name):<28}  ", (about, "dim")))
        for name, about in named.items()
        if wanted.casefold() in name.casefold()
    ]
    if drive and not wanted:
        matches.append(
            Match(UPLOAD, Text.assemble(f"{'the program in ' + drive:<28}  ", ("/upload into a new file", "dim")))
        )
    if wanted and wanted not in named:
        own = Match(wanted, Text.assemble(f"{visible(wanted):<28}  ", ("open it, or begin it as a new file", "dim")))
        matches.insert(0 if "." in wanted else len(matches), own)
    return matches


# Download


def download_choices(text: OpenText, target: str) -> list[Choice]:
    """The ways to send a file to a drive."""
    file = quoted(text.name)
    first = "Save the file and send it" if text.changed or text.file.new else "Send it"
    return [
        Choice(first, with_target("/download", file, target)),
        Choice(f"{first}; keep it at power-off", with_target("/download", file, target, "--save")),
        Choice(f"{first} unless the drive holds it", with_target("/download", file, target, "--only-changed")),
    ]


def download_facts(text: OpenText, findings: Findings, program: ProgramFacts) -> list[str]:
    """What a person should know before: errors, and what becomes of the program in the drive."""
    wrong = len(errors(findings.problems))
    lines = (
        [
            f"✗ {wrong} errors: it will be refused, and nothing is sent"
            if wrong > 1
            else "✗ an error: it will be refused, and nothing is sent"
        ]
        if wrong
        else []
    )
    if program.line is not None:
        lines.append("its program runs: it is ended first")
    return [*lines, "What the drive holds is read and saved to a backup first, then replaced."]


# Run


def run_choices(entries: Sequence[Entry], target: str, program: ProgramFacts) -> list[Choice]:
    """Ways to run a program, and what else can be done while one runs or waits."""
    start = f"@{target} " if target else ""
    found: list[Choice] = []
    if program.line is not None:
        found.append(Choice("Go on at normal speed", with_target("/continue", target)))
        found.append(Choice("Break it where it is", with_target("/break", target, "now")))
    for verb, what in (("", "Run from"), ("/trace", "Trace from"), ("/step", "Step by step from")):
        for each in entries:
            line = with_target(verb, target, each.name) if verb else f"{start}{each.start}"
            found.append(Choice(f"{what} {each.name}", line))
    if program.break_point:
        found.append(Choice(f"Remove the break point {program.break_point}", with_target("/break", target, "off")))
    return [*found, Choice("List what the drive holds", with_target("/list", target))]


def choices_like(choices: Sequence[Choice], typed: str) -> list[Match]:
    """The choices that contain every typed word; the key of each is its number."""
    words = typed.casefold().split()
    return [
        Match(str(number), Text.assemble(f"{each.title:<30}  ", (visible(each.line), "dim")))
        for number, each in enumerate(choices)
        if all(word in f"{each.title} {each.line}".casefold() for word in words)
    ]
