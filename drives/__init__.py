"""The host's side of a line: Line, Bus, Drive, procedures, telemetry."""

from dialects import Hints
from drives.bus import Bus
from drives.drive import GLOBAL, Drive
from drives.telemetry import Subscription, Telemetry

__all__ = ["GLOBAL", "Bus", "Drive", "Hints", "Subscription", "Telemetry"]
