"""A macro in the editor of a person, in a terminal of its own."""

from __future__ import annotations

import errno
import shutil
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path

from multidrop.base.errors import Diagnostic
from multidrop.base.files import why
from multidrop.macros import MacroStore
from multidrop.macros.store import begin_draft, finish_draft
from multidrop.shell.macro_changes import editor


def edited(store: MacroStore, drafts: Path, name: str, warn: Callable[[str], None]) -> str:
    """Open a copy in the person's editor; put it in place of the macro once it is right. Return what was done."""
    command = editor()
    draft = begin_draft(store, drafts, name)
    if draft.remark:
        warn(draft.remark)
    _run([*command, str(draft.file)], f"{name} is as it was")
    return finish_draft(store, draft)


def _run(command: list[str], otherwise: str) -> None:
    """Run an editor to its end; Ctrl+C is its own. Raises Diagnostic where it cannot run or fails."""
    before = signal.getsignal(signal.SIGINT)
    try:
        with subprocess.Popen(command) as process:
            signal.signal(signal.SIGINT, signal.SIG_IGN)
            code = process.wait()
    except OSError as problem:
        # A folder of the PATH that may not be read gives another reason than that there is no such program.
        error = problem if shutil.which(command[0]) else FileNotFoundError(errno.ENOENT, "")
        raise Diagnostic(f"cannot run ({why(error)})", command[0], f"set VISUAL or EDITOR; {otherwise}") from None
    finally:
        signal.signal(signal.SIGINT, before)
    if code:
        raise Diagnostic(f"the editor ended with {code}", command[0], f"{otherwise}; your text is in {command[-1]}")
