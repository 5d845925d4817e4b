"""The host's knowledge of one TMCL module."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from dialects.state import DriveState
from dialects.tmcl.host.codec import Tmcl


@dataclass(eq=False)
class TmclState(DriveState):
    """One module."""

    codec: Tmcl
    lost_commands: set[int] = field(default_factory=set)
    """Commands whose replies did not come, and may come late."""

    def reply_lost(self, command: int) -> None:
        """The reply to a command did not come."""
        self.lost_commands.add(command)
        self.reply_outstanding()

    def proved(self) -> None:
        """The reply to a mark came: all earlier replies are over."""
        self.lost_commands.clear()
        self.synchronised()

    def motors_counted(self, motors: int) -> None:
        """Record how many motors the module has."""
        self.codec = replace(self.codec, motors=motors)
