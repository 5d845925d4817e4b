"""`multidrop rescue`: free a drive that does not reply."""

from __future__ import annotations

import argparse
from functools import partial

from multidrop.commands.scan import conclude, made
from multidrop.dialects import Diagnostic
from multidrop.shell.front import batch
from multidrop.shell.rescuing import Rescue
from multidrop.shell.session import Session


def run(chosen: argparse.Namespace) -> int:
    """Take one step after the other until a drive replies."""
    return batch.run([], partial(_rescue, chosen), agreed=chosen.yes, unsolicited=False)


async def _rescue(chosen: argparse.Namespace, session: Session) -> None:
    scanning = made(chosen, session)
    rescue = Rescue(session, scanning)
    await rescue.run([chosen.baud] if chosen.baud else [], everything=chosen.all, erase=chosen.erase)
    if chosen.plain:
        if len(scanning.found) > 1:
            names = ", ".join(each.state.address for each in scanning.found)
            raise Diagnostic(f"--plain is for a drive that is alone; {names} replied", chosen.url, "nothing was set")
        await rescue.make_plain(scanning.found[0])
    conclude(chosen, session, scanning.found)
