"""`multidrop certify`: write a report on a drive, or compare a drive with one."""

from __future__ import annotations

from multidrop.base import new_file
from multidrop.base.errors import Diagnostic
from multidrop.features.certify import certificate
from multidrop.shell.batch import runner
from multidrop.shell.params.work import is_several, targets
from multidrop.shell.session import Session

DIFFERS = 1
"""The exit code of a comparison where an answer differs."""


def run(url: str, drive: str, output: str, compare: str, agreed: bool) -> int:
    """Write a report, or compare a drive with one; report a wrong file before anything is opened."""
    if is_several(drive):
        raise Diagnostic(f"--drive {drive}: a report is of one drive", "certify", "name one")
    theirs = certificate.load(compare) if compare else None
    if theirs is None:
        new_file.check(output, printed=True)

    async def work(session: Session) -> int:
        [certified] = targets(session, session.origin, drive)
        if theirs is not None:
            return DIFFERS if await certificate.compare(session, certified, compare, theirs) else 0
        await certificate.certify(session, certified, output)
        return 0

    return runner.run([url], work, agreed=agreed, unsolicited=False, tried=[drive])
