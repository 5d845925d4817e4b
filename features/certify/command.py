"""`multidrop certify`: write a report on a drive, or compare a drive with one."""

from __future__ import annotations

import argparse

from multidrop.base import new_file
from multidrop.base.errors import Diagnostic
from multidrop.features.certify import certificate
from multidrop.shell.batch import runner
from multidrop.shell.params.work import is_several, targets
from multidrop.shell.session import Session

DIFFERS = 1
"""The exit code of a comparison where an answer differs."""


def run(chosen: argparse.Namespace) -> int:
    """Write a report, or compare a drive with one; report a wrong file before anything is opened."""
    if is_several(chosen.drive):
        raise Diagnostic(f"--drive {chosen.drive}: a report is of one drive", "certify", "name one")
    theirs = certificate.load(chosen.compare) if chosen.compare else None
    if theirs is None:
        new_file.check(chosen.output, printed=True)

    async def work(session: Session) -> int:
        [drive] = targets(session, chosen.drive)
        if theirs is not None:
            return DIFFERS if await certificate.compare(session, drive, chosen.compare, theirs) else 0
        await certificate.certify(session, drive, chosen.output)
        return 0

    return runner.run([chosen.url], work, agreed=chosen.yes, unsolicited=False, tried=[chosen.drive])
