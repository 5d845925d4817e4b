"""Files written whole or not at all: one that replaces a user's file, with its mode, owner and links, or a new one."""

from __future__ import annotations

import contextlib
import errno
import os
import sys
from pathlib import Path


def write_atomically(path: Path, data: bytes, mode: int = 0o666) -> None:
    """Replace a file's content, or create the file with `mode` less the umask. On OSError the old file is unchanged.

    A new file in the same folder replaces the old one only once all of it is on the disk. A link stays a link.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    target = Path(os.path.realpath(path))
    beside = target.with_name(f".{target.name}.{os.urandom(4).hex()}.tmp")
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
    sync_folder(target.parent)


def create_atomically(path: Path, data: bytes) -> None:
    """Create a file; it has its name only once all of it is on the disk. Raises FileExistsError where one is there."""
    beside = path.with_name(f".{path.name}.{os.urandom(4).hex()}.tmp")
    try:
        with open(beside, "xb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        _name_new(beside, path)
    finally:
        with contextlib.suppress(OSError):
            beside.unlink()
    sync_folder(path.parent)


def _name_new(beside: Path, path: Path) -> None:
    """Give a whole file its name, unless another has it. Windows' rename refuses that, and some disks have no links."""
    if sys.platform == "win32":
        os.rename(beside, path)
        return
    try:
        os.link(beside, path)
    except FileExistsError:
        raise
    except OSError:
        if os.path.lexists(path):
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(path)) from None
        os.rename(beside, path)


def _take_over(old: Path, new: int) -> None:
    """Copy owner and mode of the old file, if there is one, to the new file."""
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


def sync_folder(folder: Path) -> None:
    """Make the new name survive a power cut, where folders can be synced; the file is whole already."""
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
