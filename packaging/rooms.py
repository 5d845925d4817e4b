"""The wheel holds one package: the folders of the root go into it as `multidrop.ROOM`, from any checkout or archive.

An editable install copies nothing: there the root is on the path, and the links in `multidrop` lead to the rooms.
"""

from __future__ import annotations

from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

ROOMS = ("tui", "shell", "macros", "drives", "simulator", "dialects", "transports", "base", "families", "features")


class Rooms(BuildHookInterface[Any]):
    """The hook of the wheel."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Add the rooms to a wheel that is no editable one."""
        if version != "editable":
            build_data["force_include"] |= {f"{self.root}/{room}": f"multidrop/{room}" for room in ROOMS}
