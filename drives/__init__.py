"""The host's side of a line: wire, link, conversations, drives, stops, telemetry."""

from dialects import Hints
from drives.bus import Bus
from drives.drive import Drive
from drives.keeping import GLOBAL
from drives.telemetry import Subscription, Telemetry

__all__ = ["GLOBAL", "Bus", "Drive", "Hints", "Subscription", "Telemetry"]
