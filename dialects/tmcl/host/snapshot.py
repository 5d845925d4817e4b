"""Reading everything of a module: its stored settings and its position. Nothing moves, and nothing is cleared."""

from __future__ import annotations

from multidrop.dialects.codec import Procedure
from multidrop.dialects.parameters import Progress
from multidrop.dialects.snapshots import Snapshot
from multidrop.dialects.tmcl.host import settings
from multidrop.dialects.tmcl.host.exchange import read
from multidrop.dialects.tmcl.host.motors import motors
from multidrop.dialects.tmcl.host.operations import moving
from multidrop.dialects.tmcl.host.state import TmclState
from multidrop.dialects.tmcl.manual.commands import Call, Command
from multidrop.dialects.tmcl.manual.parameters import BAUDS, Axis, Global


def take(state: TmclState, progress: Progress) -> Procedure[Snapshot]:
    """Read a module. Raises NoAnswer."""
    readings = yield from settings.read(state, progress)
    remarks = []
    if active := (yield from moving(state)):
        remarks.append("moving while it was read: its position is one of that moment")
    if (count := (yield from motors(state))) > 1:
        remarks.append(f"it has {count} motors; a simulated module has one")
    code = readings.values.get(f"G{int(Global.BAUD)}")
    return Snapshot(
        kind="tmcl",
        product=state.product,
        version=_version(state),
        name=state.address,
        baud=BAUDS.get(code, 0) if isinstance(code, int) else 0,
        readings=readings,
        counters={"position": ((yield from read(state, Call(Command.GAP, Axis.ACTUAL_POSITION, 0))),)},
        active=active,
        remarks=tuple(remarks),
    )


def _version(state: TmclState) -> str:
    """Module and firmware as the module's text form has them, `1241V115`; empty where it does not report them."""
    module, (major, _, minor) = state.product.rpartition("-")[2], state.version.partition(".")
    return f"{module}V{major}{minor}" if module.isdecimal() and major else ""
