"""The families of drives by name, and how each finds out what is on a line."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from dialects.base import Codec, DriveState, Hints, Procedure
from dialects.mcode.host import identify as mcode
from dialects.mcode.host.codec import MCode
from dialects.modbus.host import identify as modbus
from dialects.modbus.host.codec import Modbus
from dialects.modbus.host.messages import pdu_codec
from dialects.pmx.host import identify as pmx
from dialects.pmx.host.codec import Pmx

Identify = Callable[[Hints], Procedure[list[DriveState]]]

IDENTIFY: Mapping[str, Identify] = {"mcode": mcode.identify, "modbus": modbus.identify, "pmx": pmx.identify}
PLAIN: Mapping[str, Codec] = {"mcode": MCode(), "modbus": Modbus(), "pmx": Pmx()}
"""Each family's dialect where nothing is known of the drives: what a stop speaks then."""
PREPARE: Mapping[str, Callable[[], object]] = {"modbus": pdu_codec}
"""What takes long before a family's first message, and may be done in any thread."""
MINDFUL = frozenset({"mcode"})
"""Families whose opening puts right what a session that was cut off has left (`Hints.cut`, `Hints.owed`)."""
DEFAULT = "mcode"
