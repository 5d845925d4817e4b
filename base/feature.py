"""What a feature declares: its name, its meaning, and everything that it adds, in one record.

A feature adds records of the classes that the rooms read: `shell.operations.operation.Operation` (a verb, a command),
`shell.operations.operation.Options` (options of a command that is there), `shell.hooks.AtSession` (what is done when a
session opens: subscribe to its events), and so on; docs/plugins.md lists them. The rooms ask `base.registry.added` for
the records of their class, so they know no feature.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.machinery import PathFinder

NAME = re.compile(r"[a-z][a-z0-9_]*")


@dataclass(frozen=True)
class Feature:
    """A feature. Raises ValueError for a name that is no Python word in small letters."""

    name: str
    meaning: str
    """What it is for, in a few words."""
    adds: tuple[object, ...] = ()
    """Records of what it adds, in any order."""
    extras: Mapping[str, str] = field(default_factory=dict)
    """The extras of the distribution that it uses: each with a module that is there once it is installed."""

    def __post_init__(self) -> None:
        if not NAME.fullmatch(self.name):
            raise ValueError(f"the name of a feature is a Python word in small letters, not {self.name!r}")

    def missing(self) -> list[str]:
        """The extras that are not installed."""
        return [extra for extra, module in self.extras.items() if PathFinder.find_spec(module) is None]
