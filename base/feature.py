"""What a feature declares: its name, its meaning, and everything that it adds, in one record.

A feature adds records of the classes that the rooms read: `shell.operations.operation.Operation` (a verb, a command),
`shell.hooks.Options` (options of a command that is there), `shell.at_session.AtSession` (what is done when a session
opens: subscribe to its events), and so on; docs/plugins.md lists them. The rooms ask `base.registry.added` for the
records of their class, so they know no feature.

A class of records may have two methods: `claims` gives what only one feature can add, in words, and `passes` the kinds
of errors that the callers of its functions expect, by the names of these (`base.foreign`).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from importlib.machinery import PathFinder
from types import MappingProxyType
from typing import NamedTuple

NAME = re.compile(r"[a-z][a-z0-9_]*")
Kinds = tuple[type[BaseException], ...]
"""Kinds of what a function may raise."""
GUARD = "guarded_by"
"""The attribute of a function of a feature by others with its `base.foreign.ForeignGuard`."""


class Feature(NamedTuple):
    """A feature. Its name is a Python word in small letters."""

    name: str
    meaning: str
    """What it is for, in a few words."""
    adds: tuple[object, ...] = ()
    """Records of what it adds, in any order."""
    extras: Mapping[str, str] = MappingProxyType({})
    """The extras of the distribution that it uses: each with a module that is there once it is installed."""

    def wrong(self) -> str:
        """What is wrong in its form, in words; empty: nothing."""
        if not (isinstance(self.name, str) and isinstance(self.meaning, str)):
            return "name and meaning are texts"
        if type(self.adds) not in (tuple, list):  # one record without a comma behind it is a tuple, too
            return "adds is a tuple of records, as in (RECORD,)"
        if not (isinstance(self.extras, Mapping) and all(isinstance(extra, str) for extra in self.extras.values())):
            return "extras is a mapping of names to names of modules"
        return ""

    def missing(self) -> list[str]:
        """The extras that are not installed."""
        return [extra for extra, module in self.extras.items() if PathFinder.find_spec(module) is None]
