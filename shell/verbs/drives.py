"""Verbs that work with a drive: its program, waiting for it, and the world of a simulated one."""

from __future__ import annotations

import shlex

from dialects import Diagnostic
from dialects.files import why
from drives.drive import Drive
from shell import waits
from shell.simulated import floor_of
from shell.verbs.registry import Call, as_typed, verb
from simulator.sim_words import MEANINGS, SIM, table


def _list_parts(call: Call) -> tuple[Drive, str]:
    words = call.words(0, 2)
    files = [word for word in words if "." in word or "/" in word]
    targets = [word for word in words if word not in files]
    if len(files) > 1 or len(targets) > 1:
        raise call.wrong()
    return call.drive(targets[0] if targets else ""), files[0] if files else ""


def _list_recorded(call: Call) -> str:
    drive, file = _list_parts(call)
    return " ".join(
        word for word in ("/list", call.session.qualified_address(drive), shlex.quote(file) if file else "") if word
    )


@verb("/list [ADDR] [FILE]", recorded=_list_recorded)
async def list_(call: Call) -> None:
    """List the program of the selected drive, or of another one; into a new file where one is named.

    A word with a dot or a slash is a file.
    """
    from shell import transfers

    drive, file = _list_parts(call)
    lines = await transfers.readable(call.session, drive)
    if not file:
        for line in lines:
            call.session.output(line)
        return
    try:
        with open(file, "x", encoding="utf-8") as out:
            out.writelines(f"{line}\n" for line in lines)
    except (OSError, ValueError) as problem:
        raise Diagnostic(f"cannot be written: {why(problem)}", file) from None
    call.session.notify(f"{call.session.display_name(drive)}: {len(lines)} lines in {file}")


def _download_recorded(call: Call) -> str:
    words = call.words(1, 2)
    drive = call.drive(words[1] if len(words) > 1 else "")
    return f"/download {shlex.quote(words[0])} {call.session.qualified_address(drive)}".rstrip()


@verb("/download FILE [ADDR]", recorded=_download_recorded)
async def download(call: Call) -> None:
    """Send a program file to the selected drive, or to another one.

    A program that defines the same labels must be cleared first (CP).
    """
    from shell import transfers

    words = call.words(1, 2)
    await transfers.download(call.session, call.drive(words[1] if len(words) > 1 else ""), words[0])


@verb("/sleep SECONDS", recorded=as_typed)
async def sleep(call: Call) -> None:
    """Wait that many seconds."""
    (text,) = call.words(1, 1)
    await waits.sleep(waits.seconds(text, call.wrong))


@verb(
    "/wait stopped|idle [SECONDS]",
    recorded=as_typed,
    words={"stopped": "until all stand", "idle": "until all stand and no program runs"},
)
async def wait(call: Call) -> None:
    """Wait until every drive that was addressed so far stands (idle: and runs no program); 60 s unless given.

    The selected drive where none was addressed yet. A drive stands when it twice says so, 50 ms apart. A wait that runs
    out is a failure.
    """
    words = call.words(1, 2)
    if words[0] not in ("stopped", "idle"):
        raise call.wrong()
    limit = waits.seconds(words[1], call.wrong) if len(words) > 1 else waits.LIMIT
    await waits.wait(call.session, limit, idle=words[0] == "idle")


@verb(
    f"/sim {SIM}",
    recorded=as_typed,
    immediate=True,
    words=MEANINGS,
    table=table,
    fits=lambda session: floor_of(session) is not None,
)
async def sim(call: Call) -> None:
    """Move the world of simulated drives."""
    session = call.session
    floor = floor_of(session)
    if floor is None:
        raise Diagnostic("no simulated bus is selected", "/sim", "/open sim: opens the demo cell")
    remark = floor.command(f"/sim {call.rest}")
    if remark:
        session.notify(remark)
