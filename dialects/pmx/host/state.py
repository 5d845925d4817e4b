"""The host's knowledge of one PMX controller."""

from __future__ import annotations

from dataclasses import dataclass

from multidrop.dialects.pmx.host.codec import Pmx
from multidrop.dialects.state import DriveState


@dataclass(eq=False)
class PmxState(DriveState):
    """One PMX controller."""

    codec: Pmx
