"""The files that a process has left, as the next one finds them: each can be read, whatever ended the one before."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

from multidrop.base.errors import Diagnostic
from multidrop.features.log_analysis.judge import judged
from multidrop.macros import MacroStore
from multidrop.shell.log.files import LOG_SUFFIX, entry_of, whole
from soak.simulation.records.history import History


def unreadable(folder: Path, when: str, history: History) -> list[str]:
    """The files of a state and a configuration folder that are damaged, `when` they were found."""
    return [
        f"{when}: {each}"
        for each in (
            *_state(folder / "state", history),
            *_state(folder / "data", history),
            *_macros(folder / "config" / "macros"),
        )
    ]


def _state(state: Path, history: History) -> Iterator[str]:
    for path in sorted(state.rglob("*")) if state.is_dir() else ():
        name = str(path.relative_to(state))
        if path.suffix == ".json" and not _is_json(path):
            yield f"{name} is damaged"
        if path.suffix == ".drives" and not _is_json(path):
            if not history.counts.get("power cuts"):
                yield f"{name} is damaged"
            history.count("files, but for a memory of drives after a power cut (decision 0027)")
        if (
            path.parent.name == "backups"
            and path.suffix != ".tmp"
            and not path.read_text().startswith(("'", "*", "#", "//", ";"))
        ):
            yield f"{name} is damaged"
        if LOG_SUFFIX in path.name:
            lines = path.read_bytes().split(b"\n")[:-1]
            yield from (f"{name}: {line!r}" for line in lines if entry_of(line + b"\n") is None)


def breaches_in_logs(folder: Path, history: History) -> Iterator[str]:
    """What `log judge` finds in the logs of all lives."""
    for path in (*sorted((folder / "state" / "logs").glob(f"*{LOG_SUFFIX}")), folder / "session.log"):
        if path.exists():
            history.count("logs judged")
            yield from (
                f"{path.name}:{each.line.number}: {each.rule}: {each.text}" for each in judged(whole(path)).breaches
            )


def backups(folder: Path) -> dict[str, str]:
    """The backups of programs that are on the disk, by path."""
    found = sorted((folder / "data" / "backups").rglob("*"))
    return {str(path): path.read_text() for path in found if path.is_file() and path.suffix != ".tmp"}


def _is_json(path: Path) -> bool:
    try:
        json.loads(path.read_text())
    except ValueError:
        return False
    return True


def _macros(folder: Path) -> Iterator[str]:
    for path in sorted(folder.glob("*.toml")):
        try:
            MacroStore(folder).load(path.stem)
        except Diagnostic as problem:
            yield str(problem)
