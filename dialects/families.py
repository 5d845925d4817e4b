"""The families of drives by name, and how each finds out what is on a line."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from dialects.base import Dialect, Hints, Known, Talk
from dialects.mcode import opening as mcode
from dialects.mcode.dialect import MCode
from dialects.modbus import opening as modbus
from dialects.modbus.codec import codec
from dialects.modbus.dialect import Modbus
from dialects.pmx import opening as pmx
from dialects.pmx.dialect import Pmx

Identify = Callable[[Hints], Talk[list[Known]]]

IDENTIFY: Mapping[str, Identify] = {"mcode": mcode.identify, "modbus": modbus.identify, "pmx": pmx.identify}
PLAIN: Mapping[str, Dialect] = {"mcode": MCode(), "modbus": Modbus(), "pmx": Pmx()}
"""Each family's dialect where nothing is known of the drives: what a stop speaks then."""
PREPARE: Mapping[str, Callable[[], object]] = {"modbus": codec}
"""What takes long before a family's first message, and may be done in any thread."""
MINDFUL = frozenset({"mcode"})
"""Families whose opening puts right what a session that was cut off has left (`Hints.cut`, `Hints.owed`)."""
DEFAULT = "mcode"
