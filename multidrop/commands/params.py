"""`multidrop params backup|diff|restore`: keep a drive's settings in a file, compare them, restore them."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from multidrop.commands.failure import fail
from multidrop.dialects import Diagnostic
from multidrop.shell.front import batch
from multidrop.shell.lines import split_target
from multidrop.shell.params import file as files
from multidrop.shell.params import work
from multidrop.shell.params.restore import Options

if TYPE_CHECKING:
    from multidrop.drives.drive import Drive
    from multidrop.shell.session import Session

DIFFERS = 1
"""The exit code of a comparison where something differs, as where a drive did not reply or refused."""


def backup(chosen: argparse.Namespace) -> int:
    """Save the settings of a drive to a new file."""
    try:
        work.check_new(chosen.file, chosen.drive)
    except Diagnostic as problem:
        return fail(problem)
    return batch.run(
        [chosen.url],
        lambda session: work.backup(session, chosen.file, chosen.drive),
        unsolicited=False,
        tried=chosen.drive.split(","),
    )


def diff(chosen: argparse.Namespace) -> int:
    """Print what differs; the exit code says whether anything does."""
    try:
        _check_comparison(chosen)
    except Diagnostic as problem:
        return fail(problem)
    differs = False

    async def compare(session: Session) -> None:
        nonlocal differs
        other = await _other(session, chosen)
        differs = await work.diff(session, chosen.drive, name=chosen.file, other=other, as_json=chosen.json)

    tried = [*chosen.drive.split(","), "" if chosen.against else chosen.other]
    code = batch.run([chosen.url], compare, unsolicited=False, tried=tried)
    return code or (DIFFERS if differs else 0)


def _check_comparison(chosen: argparse.Namespace) -> None:
    """Raise Diagnostic unless one thing to compare with is named, and can be read."""
    given = [bool(chosen.file), bool(chosen.against or chosen.other), chosen.defaults]
    if sum(given) != 1:
        raise Diagnostic(
            "params diff compares with one thing", hint="FILE, --against URL or --other ADDR, or --defaults"
        )
    if chosen.file and not work.is_several(chosen.drive):
        files.load(chosen.file)


async def _other(session: Session, chosen: argparse.Namespace) -> Drive | None:
    """The other drive, of another URL or of this one; None where a file or the defaults are compared."""
    if not (chosen.against or chosen.other):
        return None
    bus, address = split_target(chosen.other)
    if chosen.against and chosen.against != chosen.url:
        bus = (await session.open(chosen.against))[0].name
    return session.drive(bus, address or None)


def restore(chosen: argparse.Namespace) -> int:
    """Send what differs from a file, after a question."""
    options = Options(
        named=frozenset(name.strip().upper() for each in chosen.named for name in each.split(",") if name.strip()),
        communication=chosen.communication,
        save=chosen.save,
        dry_run=chosen.dry_run,
        other_product=chosen.other_product,
    )
    try:
        if not work.is_several(chosen.drive):
            files.load(chosen.file)
    except Diagnostic as problem:
        return fail(problem)

    async def put(session: Session) -> None:
        await work.restore_each(session, chosen.file, chosen.drive, options)

    return batch.run([chosen.url], put, agreed=chosen.yes, unsolicited=False, tried=chosen.drive.split(","))
