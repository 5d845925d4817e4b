"""`multidrop tui --join`: a watcher's screen in a terminal, from its connection to an orderly end."""

from __future__ import annotations

import asyncio
import sys

from multidrop.base.errors import Diagnostic
from multidrop.features.shared_screen import SCREENS
from multidrop.shell.configuration import load
from multidrop.shell.prompt.keyboard import SWITCH
from multidrop.tui.launch import driver, release, show

if sys.platform != "win32":
    from multidrop.features.shared_screen.join import joined
    from multidrop.features.shared_screen.mirror import watch

assert sys.platform != "win32"


def join(where: str) -> int:
    """Watch a screen that this account shares, as `features.shared_screen.join.joined` finds it. Raises Diagnostic."""
    settings = load(lenient=True)
    connection, name, early = joined(where, settings.state / SCREENS)
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        connection.close(False)
        raise Diagnostic("the screen needs a terminal", "tui --join")
    sys.setswitchinterval(SWITCH)

    async def body() -> int:
        app = watch(connection, name, early, settings, driver())
        app.stops_to_the_end = True
        try:
            return await show(app)
        finally:
            await app.session.close()
            release(app)

    try:
        return asyncio.run(body())
    finally:
        connection.close(False)
