"""The host's knowledge of one TMCL module."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from multidrop.dialects.state import DriveState, Owed
from multidrop.dialects.tmcl.host.codec import STOPS, Tmcl


@dataclass(eq=False)
class TmclState(DriveState):
    """One module."""

    codec: Tmcl
    lost_commands: set[int] = field(default_factory=set)
    """Commands whose replies did not come, and may come late."""

    motors: int = 0
    """Number of its motors; 0: not counted."""
    relative: dict[int, int] = field(default_factory=dict)
    """Axis parameter 127 of each motor: from where MVP REL counts; a motor without an entry: not known."""

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
        self.motors = motors

    def relative_read(self, motor: int, value: int) -> None:
        """Record axis parameter 127 of a motor."""
        self.relative[motor] = value

    def relative_forgotten(self) -> None:
        """Axis parameter 127 may have changed."""
        self.relative.clear()

    def readdressed(self, address: int) -> None:
        """The module has another address from now on: requests and stops go there."""
        self.address = self.name = str(address)

    def found_storing(self) -> None:
        """The module is in download mode, or may be: it stores every command but the end of that mode."""
        self.programming, self.codec = True, replace(self.codec, storing=True)
        self.owes(Owed(0, self.name, self.product, self.version, self.part, self.serial))

    def executes(self) -> None:
        """The module executes commands again."""
        self.programming, self.codec = False, replace(self.codec, storing=False)

    def stopped(self) -> None:
        """A stop ends download mode; its replies may be late."""
        self.executes()
        self.lost_commands |= STOPS
        self.reply_outstanding()

    def line_counted(self, codec: Tmcl) -> None:
        """Record the codec that all modules of the line share: it has the motors of each."""
        self.codec = codec

    def settings_may_have_changed(self) -> None:
        """Do nothing: no setting changes its replies or its stop, so it is stopped together with the others."""
