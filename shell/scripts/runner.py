"""The session that executes scripts and macros, as they see it."""

from __future__ import annotations

from typing import Protocol

from multidrop.shell.automation import Automations
from multidrop.shell.roles import Commands


class Runner(Commands, Protocol):
    """The commands of a session, and its automations."""

    automations: Automations
