"""The session that executes scripts and macros, as they see it."""

from __future__ import annotations

from typing import Protocol

from shell.automation import Automations
from shell.roles import Commands


class Runner(Commands, Protocol):
    """The commands of a session, and its automations."""

    automations: Automations
