"""`multidrop report`: what a bug report needs. It is shown before it is written, and has no secrets."""

from __future__ import annotations

import argparse
import os
import platform
import shutil
import sys
from collections.abc import Callable, Iterator
from datetime import date, datetime
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path

from multidrop.commands.failure import fail
from multidrop.dialects import Diagnostic
from multidrop.dialects.files import bounded, opened, split_lines, why
from multidrop.dialects.text import visible
from multidrop.macros import MacroStore
from multidrop.shell.connect import settings
from multidrop.shell.new_file import STANDARD_OUTPUT
from multidrop.shell.output import write
from multidrop.shell.secrets import toml_without_secrets, without_secrets

TERMINAL = ("TERM", "COLORTERM", "TERM_PROGRAM", "LANG", "LC_ALL", "LC_CTYPE", "NO_COLOR", "PYTHONUTF8")
PRESENT = ("SSH_CONNECTION", "TMUX", "STY")
"""Variables of which only the presence matters: they hold addresses and paths."""
LONGEST = 200
"""Lines of a file in the report; the rest is counted."""


def run(chosen: argparse.Namespace) -> int:
    """Show the report, and write it to a file if the user agrees."""
    text = report()
    for line in text.splitlines():
        write(sys.stdout, line)
    if chosen.output == STANDARD_OUTPUT:
        return 0
    asked = sys.stdin.isatty() and sys.stdout.isatty()
    if not (chosen.output or asked):
        return 0
    path = Path(chosen.output or f"multidrop-report-{date.today().isoformat()}.txt")
    try:
        return _keep(path, text, chosen.yes, asked)
    except Diagnostic as problem:
        return fail(problem)


def _keep(path: Path, text: str, agreed: bool, asked: bool) -> int:
    """Write the report to a new file. Raises Diagnostic."""
    if not agreed and not asked:
        raise Diagnostic("not written: this is not a terminal", str(path), "read the report above, then add --yes")
    if not agreed and not _agrees(path):
        write(sys.stderr, "nothing was written")
        return 0
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise Diagnostic("exists already", str(path), "choose another name with -o") from None
    except (OSError, ValueError) as problem:
        raise Diagnostic(f"cannot be written: {why(problem)}", str(path)) from None
    write(sys.stderr, f"the report is in {path}")
    return 0


def _agrees(path: Path) -> bool:
    sys.stderr.write(f"\nWrite the report to {path}? [y/N] ")
    sys.stderr.flush()
    try:
        return input().strip().lower() in ("y", "yes")
    except EOFError:
        return False


def report() -> str:
    """All sections, without control characters and secrets."""
    parts = []
    for title, lines in SECTIONS.items():
        parts += [f"== {title}", *(f"  {visible(without_secrets(line), tabs=True)}" for line in lines()), ""]
    return "\n".join(parts).rstrip() + "\n"


def _program() -> Iterator[str]:
    import multidrop

    yield f"multidrop {multidrop.__version__} in {Path(multidrop.__file__).parent.parent}"
    yield f"{platform.python_implementation()} {platform.python_version()} ({sys.executable})"
    yield " ".join((platform.system(), platform.release(), platform.machine(), *platform.libc_ver()))
    yield f"time {datetime.now().astimezone().isoformat(timespec='seconds')}"


def _packages() -> Iterator[str]:
    """The version of every package that multidrop may use."""
    try:
        needed = requires("multidrop") or []
    except PackageNotFoundError:
        yield "not installed: it runs from a source tree"
        return
    for need in needed:
        name = need.partition(";")[0].split("<")[0].split(">")[0].split("=")[0].split("[")[0].strip()
        extra = need.partition("extra ==")[2].strip(" '\"")
        try:
            found = version(name)
        except PackageNotFoundError:
            found = "not installed"
        yield f"{name} {found}" + (f" (extra {extra})" if extra else "")


def _terminal() -> Iterator[str]:
    columns, rows = shutil.get_terminal_size()
    streams = [name for name in ("stdin", "stdout", "stderr") if getattr(sys, name).isatty()]
    yield f"terminals: {', '.join(streams) or 'none'}; {columns}x{rows}; encoding {sys.stdout.encoding}"
    for name in TERMINAL:
        if name in os.environ:
            yield f"{name}={os.environ[name]}"
    for name in PRESENT:
        if name in os.environ:
            yield f"{name} is set"


def _configuration() -> Iterator[str]:
    path = settings.config_file()
    yield str(path)
    yield from _contents(path)
    try:
        settings.load()
    except Diagnostic as problem:
        yield f"problem: {problem}"


def _macros() -> Iterator[str]:
    """The names of the macros; the problem of a file in place of its contents."""
    store = MacroStore(settings.config_folder() / "macros")
    yield str(store.folder)
    try:
        names = store.names()
    except Diagnostic as problem:
        yield f"problem: {problem}"
        return
    for name in names:
        try:
            macro = store.load(name)
        except Diagnostic as problem:
            yield f"problem: {problem}"
        else:
            yield f"{macro.name} {macro.key}".rstrip()


def _ports() -> Iterator[str]:
    from multidrop.transports.serial_ports import list_ports

    found = list_ports()
    for port in found:
        yield "  ".join(part for part in (port.device, port.stable_name, port.description) if part)
    if not found:
        yield "no serial port"


def _state() -> Iterator[str]:
    """The files of the state folder. Their contents stay: the history has what was typed."""
    folder = settings.state_folder()
    yield str(folder)
    try:
        files = sorted(path for path in folder.rglob("*") if path.is_file())
        for path in files[:LONGEST]:
            yield f"{path.stat().st_size:>10} {path.relative_to(folder)}"
    except OSError as problem:
        yield f"problem: {why(problem)}"


def _contents(path: Path) -> Iterator[str]:
    """The lines of a file; the reason where it cannot be read."""
    try:
        with opened(path) as file:
            text = bounded(file, str(path)).decode("utf-8", "backslashreplace")
        lines = split_lines(toml_without_secrets(text))
    except FileNotFoundError:
        yield "no such file"
    except OSError as problem:
        yield f"problem: {why(problem)}"
    except Diagnostic as problem:
        yield f"problem: {problem}"
    else:
        yield from lines[:LONGEST]
        if len(lines) > LONGEST:
            yield f"... {len(lines) - LONGEST} more lines"


SECTIONS: dict[str, Callable[[], Iterator[str]]] = {
    "multidrop": _program,
    "packages": _packages,
    "terminal": _terminal,
    "configuration": _configuration,
    "macros": _macros,
    "serial ports": _ports,
    "state folder": _state,
}
