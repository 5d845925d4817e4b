"""Verbs for the program in a drive: list it, save it to a file, replace it."""

from __future__ import annotations

import shlex

from multidrop.drives.drive import Drive
from multidrop.shell import listings, new_file, transfers
from multidrop.shell.verbs.registry import Call, verb


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
    """List the program of a drive, or write the list into a new file.

    A word with a dot or a slash is a file. `/upload` writes a file that can be downloaded again.
    """
    drive, file = _list_parts(call)
    if file:
        new_file.check(call.output_file(file), printed=True)
    lines = await listings.readable(call.workspace, drive)
    if not file:
        for line in lines:
            call.workspace.output(line)
        return
    listings.save_new(call.workspace, drive, file, lines)


def _upload_recorded(call: Call) -> str:
    words = call.words(1, 2)
    drive = call.drive(words[1] if len(words) > 1 else "")
    return f"/upload {shlex.quote(words[0])} {call.workspace.qualified_address(drive)}".rstrip()


@verb("/upload FILE [ADDR]", recorded=_upload_recorded)
async def upload(call: Call) -> None:
    """Save the program of a drive, with its variables, to a new file that can be downloaded again.

    It has the remarks and the layout of the file that was downloaded last with the same lines.
    """
    words = call.words(1, 2)
    file, drive = call.output_file(words[0]), call.drive(words[1] if len(words) > 1 else "")
    new_file.check(file, printed=True)
    listings.save_new(call.workspace, drive, file, await listings.upload(call.workspace, drive))


OPTIONS = {
    "--save": "save it with S",
    "--only-changed": "send nothing where the drive holds it already",
    "--no-verify": "do not read it back",
    "--run": "execute the program at this label",
}


def _download_parts(call: Call) -> tuple[str, str, transfers.Wanted]:
    """The file, the address, and the options, in any order."""
    places: list[str] = []
    options: dict[str, str] = {}
    words = iter(call.words(1))
    for word in words:
        if word in options or (word.startswith("--") and word not in OPTIONS):
            raise call.wrong(f"{word} is given twice" if word in options else f"no option {word}")
        if word not in OPTIONS:
            places.append(word)
        elif not (value := next(words, "") if word == "--run" else word):
            raise call.wrong("--run needs a label")
        else:
            options[word] = value
    if not 1 <= len(places) <= 2:
        raise call.wrong()
    wanted = transfers.Wanted(
        verify="--no-verify" not in options,
        save="--save" in options,
        only_changed="--only-changed" in options,
        run=options.get("--run", ""),
    )
    return places[0], places[1] if len(places) > 1 else "", wanted


def _download_recorded(call: Call) -> str:
    file, target, wanted = _download_parts(call)
    address = call.workspace.qualified_address(call.drive(target))
    options = {
        "--save": wanted.save,
        "--only-changed": wanted.only_changed,
        "--no-verify": not wanted.verify,
        f"--run {wanted.run}": bool(wanted.run),
    }
    words = ("/download", shlex.quote(file), address, *(word for word, given in options.items() if given))
    return " ".join(word for word in words if word)


@verb(
    "/download FILE [ADDR] [--save] [--only-changed] [--no-verify] [--run NAME]",
    recorded=_download_recorded,
    words=OPTIONS,
)
async def download(call: Call) -> None:
    """Send a program file to a drive: check it, back up what the drive holds, send it, read it back.

    The program that it replaces is cleared (CP); a program at another address stays.
    """
    file, target, wanted = _download_parts(call)
    await transfers.download(call.session, call.drive(target), file, wanted, by=call.by)
