"""Change the faults of a simulated wire while it is used; a cell file sets them for good."""

from random import Random

from multidrop.simulator.cell.spec import Faults
from multidrop.simulator.wire import Wire

NONE = Faults()


def disturb(wire: Wire, faults: Faults = NONE, seed: int | None = None) -> None:
    """Give a wire these faults; `seed`: and another source of chance."""
    wire.disturb(faults, None if seed is None else Random(seed))
