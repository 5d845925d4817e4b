"""The choices of the program page: a file, a way to download, a way to run. Each shows its line."""

from __future__ import annotations

import os
import shlex
from collections.abc import Sequence
from datetime import datetime
from typing import NamedTuple

from rich.text import Text

from multidrop.dialects.families import program_languages
from multidrop.dialects.program_files import Entry, errors
from multidrop.shell.lines import join_target
from multidrop.tui.editor.texts import OpenText
from multidrop.tui.readout import ProgramFacts
from multidrop.tui.screens.dialogs import Match
from multidrop.tui.screens.program_rows import Findings
from multidrop.tui.session_view import SessionView
from multidrop.tui.text import visible

UPLOAD = "\0upload"
"""The choice to read what the drive holds into a new file."""
MOST_FILES = 200


class Choice(NamedTuple):
    """The effect, and the line that has it."""

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
    """A program file."""

    name: str
    about: str


def files_in(folder: str) -> list[Found]:
    """The program files in a folder, the newest first, then its folders; empty for the current one."""
    endings = {ending for files in program_languages().values() for ending in files.endings}
    files: list[tuple[float, Found]] = []
    folders: list[Found] = []
    try:
        for each in os.scandir(folder or "."):
            if each.is_dir() and not each.name.startswith("."):
                folders.append(Found(f"{folder}{each.name}/", "folder"))
            elif os.path.splitext(each.name)[1].lower() in endings and each.is_file():
                state = each.stat()
                about = f"{state.st_size} B   {datetime.fromtimestamp(state.st_mtime):%Y-%m-%d %H:%M}"
                files.append((state.st_mtime, Found(f"{folder}{each.name}", about)))
    except OSError:
        return []
    up = [Found(f"{folder}../", "the folder above")]
    return [*(each for _, each in sorted(files, reverse=True)), *sorted(folders), *up][:MOST_FILES]


class Finder:
    """Finds the files whose names contain a typed text. `here`: those of the folder `base`; empty: the current one."""

    def __init__(self, here: Sequence[Found], unsaved: Sequence[OpenText], drive: str, base: str = "") -> None:
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
        named |= {each.name: each.about for each in self._folders[folder] if each.name not in named}
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
    """The facts before a download: errors, and the fate of the program in the drive."""
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
