"""Verbs for the program in a drive: list it, keep it in a file, replace it."""

from __future__ import annotations

import shlex

from dialects import Diagnostic
from dialects.files import why
from drives.drive import Drive
from shell import transfers
from shell.verbs.registry import Call, verb


def _list_parts(call: Call) -> tuple[Drive, str]:
    words = call.words(0, 2)
    files = [word for word in words if "." in word or "/" in word]
    targets = [word for word in words if word not in files]
    if len(files) > 1 or len(targets) > 1:
        raise call.wrong()
    return call.drive(targets[0] if targets else ""), files[0] if files else ""


def _list_recorded(call: Call) -> str:
    drive, file = _list_parts(call)
    words = ("/list", call.workspace.qualified_address(drive), shlex.quote(file) if file else "")
    return " ".join(word for word in words if word)


@verb("/list [ADDR] [FILE]", recorded=_list_recorded)
async def list_(call: Call) -> None:
    """List the program of a drive, or write it into a new file.

    A word with a dot or a slash is a file.
    """
    drive, file = _list_parts(call)
    file = call.output_file(file)
    lines = await transfers.readable(call.workspace, drive)
    if not file:
        for line in lines:
            call.workspace.output(line)
        return
    try:
        with open(file, "x", encoding="utf-8") as out:
            out.writelines(f"{line}\n" for line in lines)
    except (OSError, ValueError) as problem:
        raise Diagnostic(f"cannot be written: {why(problem)}", file) from None
    call.workspace.notify(f"{call.workspace.display_name(drive)}: {len(lines)} lines in {file}")


def _download_recorded(call: Call) -> str:
    words = call.words(1, 2)
    drive = call.drive(words[1] if len(words) > 1 else "")
    return f"/download {shlex.quote(words[0])} {call.workspace.qualified_address(drive)}".rstrip()


@verb("/download FILE [ADDR]", recorded=_download_recorded)
async def download(call: Call) -> None:
    """Send a program file to a drive.

    First clear (CP) a program that defines the same labels.
    """
    words = call.words(1, 2)
    await transfers.download(call.workspace, call.drive(words[1] if len(words) > 1 else ""), words[0])
