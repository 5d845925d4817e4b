"""The verb that moves the world of simulated drives."""

from __future__ import annotations

from multidrop.dialects import Diagnostic
from multidrop.shell.verbs.registry import Call, as_typed, verb
from multidrop.simulator.sim_words import MEANINGS, SIM, table


@verb(
    f"/sim {SIM}",
    recorded=as_typed,
    immediate=True,
    words=MEANINGS,
    table=table,
    fits=lambda workspace: workspace.cell is not None,
)
async def sim(call: Call) -> None:
    """Act on simulated drives from outside: inputs, loads, power, cables."""
    cell = call.workspace.cell
    if cell is None:
        raise Diagnostic("no simulated bus is selected", "/sim", "/open sim: opens the demo cell")
    remark = cell.command(f"/sim {call.rest}")
    if remark:
        call.workspace.notify(remark)
