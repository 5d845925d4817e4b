"""Files of a person's, written whole or not at all: mode, owner and links stay as they were."""

from __future__ import annotations

import contextlib
import os
import secrets
import sys
from pathlib import Path


def write_whole(path: Path, data: bytes, mode: int = 0o666) -> None:
    """Replace a file's content, or make the file with `mode` less the umask. Raises OSError, the old file untouched.

    A new file beside the old one takes its place only when all of it is on the disk. A link stays a link.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    target = Path(os.path.realpath(path))
    beside = target.with_name(f".{target.name}.{secrets.token_hex(4)}.tmp")
    try:
        with open(os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode), "wb") as file:
            _take_over(target, file.fileno())
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(beside, target)
    except BaseException:
        with contextlib.suppress(OSError):
            beside.unlink()
        raise
    _sync_folder(target.parent)


def _take_over(old: Path, new: int) -> None:
    """Give a new file the owner and the mode of the old one, if there is one."""
    if sys.platform == "win32":
        return  # no owner and no mode to keep
    try:
        state = old.stat()
    except FileNotFoundError:
        return
    if (state.st_uid, state.st_gid) != (os.geteuid(), os.getegid()):
        with contextlib.suppress(OSError):  # not ours to give away: the mode must do
            os.fchown(new, state.st_uid, state.st_gid)
    os.fchmod(new, state.st_mode & 0o7777)


def _sync_folder(folder: Path) -> None:
    """Make the new name last through a power cut, where folders can be synced; the file is whole already."""
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
