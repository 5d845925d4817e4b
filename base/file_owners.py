"""Who besides its owner can change a file."""

from __future__ import annotations

import os
import stat
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any


def places(path: Path) -> list[Path]:
    """A file and the folders in which it can be replaced; of a link that of its target, too."""
    return list(dict.fromkeys((path, path.parent, path.resolve().parent)))


if sys.platform == "win32":

    def other_writer(path: Path) -> str:
        """Who else can change a file, in words; empty: no one, as the profile of a user is private there."""
        return ""

else:
    import grp
    import pwd

    def other_writer(path: Path) -> str:
        """Who else can change a file, or put another one in its place, in words; empty: only its owner and root can."""
        for place in places(path):
            state = os.stat(place)
            if state.st_uid not in (0, os.geteuid()):
                return f"account {_name(pwd.getpwuid, state.st_uid)}, who owns {place}"
            if state.st_mode & stat.S_ISVTX:  # as /tmp: a file there is its owner's
                continue
            if state.st_mode & stat.S_IWOTH:
                return f"every account (mode {stat.S_IMODE(state.st_mode):o} of {place})"
            if state.st_mode & stat.S_IWGRP and (group := _shared_group(state.st_gid)):
                return f"group {group} (mode {stat.S_IMODE(state.st_mode):o} of {place})"
        return ""

    def _shared_group(number: int) -> str:
        """The name of a group unless this account alone is in it, as in a group of its own; empty: it is alone."""
        name = _name(grp.getgrgid, number)
        try:
            members = grp.getgrgid(number).gr_mem
            own = pwd.getpwuid(os.geteuid()).pw_name
        except KeyError:
            return name
        alone = number == os.getegid() and name == own and not [member for member in members if member != own]
        return "" if alone or number == 0 else name

    def _name(find: Callable[[int], Sequence[Any]], number: int) -> str:
        """The name of an account or a group, or its number where the system has no name for it."""
        try:
            return str(find(number)[0])
        except KeyError:
            return str(number)
