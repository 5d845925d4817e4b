"""Verbs for the session itself: stop, log, the end."""

from __future__ import annotations

from multidrop.dialects import Diagnostic, Stopped
from multidrop.shell import stop_report
from multidrop.shell.events import By
from multidrop.shell.log import files
from multidrop.shell.log.writer import SessionLog
from multidrop.shell.new_file import STANDARD_OUTPUT
from multidrop.shell.verbs.registry import Call, verb


@verb("/stop", immediate=True)
async def stop(call: Call) -> None:
    """Stop every drive on every bus, and macros, scripts and waits.

    Ctrl+X does the same from anywhere. Macros and scripts are refused until /resume.
    """
    call.words(0, 0)
    call.workspace.stop("/stop")


@verb("/resume", immediate=True)
async def resume(call: Call) -> None:
    """Let macros and scripts run again after a stop."""
    call.words(0, 0)
    if call.by is not By.OPERATOR:
        raise Stopped("/resume works only when a person types it")
    state = f"; {stop_report.words(call.workspace.tally())}" if call.workspace.latched else ""
    call.workspace.resume()
    call.workspace.notify(f"macros and scripts may run again{state}")
    if dropped := call.workspace.dropped:
        names = ", ".join(dict.fromkeys(dropped))
        call.workspace.notify(
            f"on_stop of {names} was not executed and will not be; type its lines if needed", warning=True
        )
        dropped.clear()


@verb("/log [FILE|on|off]", immediate=True, words={"on": "a new file in the state folder", "off": "end the log"})
async def log(call: Call) -> None:
    """Append everything typed, sent, received and printed to a file, in JSON lines with the time of day.

    Without a word it shows the file. `multidrop log show` shows what is in it.
    """
    words, workspace = call.words(0, 1), call.workspace
    if not words:
        workspace.output(f"log: {workspace.log.path if workspace.log else 'off'}")
        return
    path = call.output_file(words[0])
    if path == STANDARD_OUTPUT:
        raise Diagnostic("standard output has the replies", "/log -", "name a file")
    log, before = None, workspace.log
    if words[0] != "off":
        log = SessionLog(workspace, files.fresh(workspace.settings) if words[0] == "on" else path)
    if before is not None:
        before.close()
    workspace.log = log
    workspace.notify(f"log: {workspace.log.path if workspace.log else 'off'}")
    workspace.changed()


@verb("/quit", immediate=True)
async def quit_(call: Call) -> None:
    """End multidrop; drives go on as they are.

    At a terminal it first names the drives that move or may move, and asks.
    """
    call.words(0, 0)
    ask = call.workspace.before_quit
    if ask is None or await ask():
        call.commands.quit()
