"""Files written whole or not at all: one that replaces a user's file, with its mode, owner and links, or a new one."""

from __future__ import annotations

import contextlib
import errno
import os
import sys
from pathlib import Path


def write_atomically(path: Path, data: bytes, mode: int = 0o666, *, synced: bool = True) -> None:
    """Replace a file's content, or create the file with `mode` less the umask. On OSError the old file is unchanged.

    A new file in the same folder replaces the old one only once all of it is on the disk. A link stays a link. Not
    `synced`: it survives the process, not the machine, and takes microseconds.
    """
    make_folder(path.parent, synced=synced)
    target = Path(os.path.realpath(path))
    beside = target.with_name(f".{target.name}.{os.urandom(4).hex()}.tmp")
    try:
        with open(os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode), "wb") as file:
            _take_over(target, file.fileno())
            file.write(data)
            file.flush()
            if synced:
                os.fsync(file.fileno())
        os.replace(beside, target)
    except BaseException:
        with contextlib.suppress(OSError):
            beside.unlink()
        raise
    if synced:
        with contextlib.suppress(OSError):  # the file is whole already
            sync_folder(target.parent)


def create_atomically(path: Path, data: bytes) -> None:
    """Create a file; it has its name only once all of it is on the disk. Raises FileExistsError where one is there."""
    beside = path.with_name(f".{path.name}.{os.urandom(4).hex()}.tmp")
    try:
        with open(beside, "xb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        if sys.platform == "win32":
            os.rename(beside, path)  # which refuses a name that is taken
        else:
            try:
                os.link(beside, path)
            except FileExistsError:
                raise
            except OSError:  # some disks have no links
                if os.path.lexists(path):
                    raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(path)) from None
                os.rename(beside, path)
    finally:
        with contextlib.suppress(OSError):
            beside.unlink()
    with contextlib.suppress(OSError):
        sync_folder(path.parent)


def make_folder(folder: Path, *, synced: bool = True) -> None:
    """Make a folder and those above it. `synced`: their names survive a power cut."""
    made = [each for each in (folder, *folder.parents) if not each.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    for each in made if synced else ():
        with contextlib.suppress(OSError):
            sync_folder(each.parent)


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
    """Make new names survive a power cut. Raises OSError where a folder cannot be synced; Windows has no such call."""
    if sys.platform != "win32":
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
