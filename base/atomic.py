"""Files written whole or not at all: one that replaces a user's file, with its mode, owner and links, or a new one.

Also the private files of the state folder: regular files of ours, in folders that no one else may enter.
"""

from __future__ import annotations

import contextlib
import errno
import os
import re
import stat
import sys
import time
from pathlib import Path
from urllib.parse import quote

_DEVICES = re.compile(r"CON|PRN|AUX|NUL|(COM|LPT)[0-9]", re.IGNORECASE)
UNABLE = (errno.EINVAL, errno.ENOTSUP, errno.ENOSYS, errno.EACCES, errno.EPERM)
"""What a disk says that has no sync of a folder, and a folder that may be written and not read."""


def reserved(name: str) -> bool:
    """True if Windows takes a file's name for a device, in any folder and with any ending: `COM5.line` is COM5."""
    return _DEVICES.fullmatch(name.partition(".")[0].rstrip()) is not None


def safe_name(text: str) -> str:
    """A file name for a text, safe on every system; `unquote` gives the text back (docs/decisions/0090)."""
    name = quote(text, safe="")
    if reserved(name):
        name = f"%{ord(name[0]):02X}{name[1:]}"
    return f"{name[:-1]}%2E" if name.endswith(".") else name


def write_atomically(path: Path, data: bytes, mode: int = 0o666, *, synced: bool = True, private: bool = False) -> None:
    """Replace a file's content, or create the file with `mode` less the umask. On OSError the old file is unchanged.

    A new file in the same folder replaces the old one only once all of it is on the disk. A link stays a link. Not
    `synced`: it survives the process, not the machine, and takes microseconds. `private`: a file of the state folder;
    what stands there in its place, such as a link or a pipe, is replaced and never followed.
    """
    if private:
        private_folder(path.parent)
        target = path
    else:
        make_folder(path.parent)
        target = Path(os.path.realpath(path))
    beside = target.with_name(f".{target.name}.{os.urandom(4).hex()}.tmp")
    try:
        with open(os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode), "wb") as file:
            if not private or _is_regular(target):
                _take_over(target, file.fileno())
            file.write(data)
            file.flush()
            if synced:
                os.fsync(file.fileno())
        _replace(beside, target)
    except BaseException:
        with contextlib.suppress(OSError):
            beside.unlink()
        raise
    if synced:
        with contextlib.suppress(OSError):  # the file is whole already
            sync_folder(target.parent)


NOT_REGULAR = "it is not a regular file; remove it"
REPLACE_TIMEOUT = 0.3
"""The longest wait, s, for another program that has the file open on Windows, such as one that looks for viruses."""


def _replace(new: Path, old: Path) -> None:
    until = time.monotonic() + REPLACE_TIMEOUT
    while True:
        try:
            os.replace(new, old)
            return
        except PermissionError:
            if sys.platform != "win32" or time.monotonic() > until:
                raise
            time.sleep(0.01)


def create_atomically(path: Path, data: bytes) -> None:
    """Create a file; it has its name only once all of it is on the disk. Raises FileExistsError where one is there.

    On any other OSError, of the name's own sync too, there is no file.
    """
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
    try:
        sync_folder(path.parent)
    except OSError:
        path.unlink()
        raise


def make_folder(folder: Path, mode: int = 0o777) -> None:
    """Make a folder and those above it, whose names survive a power cut. On OSError none of them is made.

    Every maker of a folder calls it: the next one syncs only the names that it makes itself.
    """
    made = [parent for parent in (folder, *folder.parents) if not parent.exists()]
    try:
        for path in reversed(made):
            path.mkdir(mode, exist_ok=True)
        folder.mkdir(mode, exist_ok=True)  # raises where a file has its name
        for path in made:
            sync_folder(path.parent)
    except OSError:
        for path in made:
            with contextlib.suppress(OSError):  # another process uses it
                path.rmdir()
        raise


def private_folder(folder: Path) -> None:
    """Make a folder that only its owner may enter, or take the rights of others on it away. Raises OSError."""
    make_folder(folder, 0o700)
    if sys.platform == "win32":
        return  # the profile of a user is private there
    state = folder.stat()
    if state.st_uid == os.geteuid() and stat.S_IMODE(state.st_mode) & 0o077:
        folder.chmod(0o700)


def open_private(path: Path, flags: int = os.O_RDONLY, mode: int = 0o600) -> int:
    """Open a regular file of the state folder; return its descriptor. A link is not followed, a pipe not waited for.

    Raises OSError, also for anything but a regular file.
    """
    flags |= getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
    try:
        descriptor = os.open(path, flags | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0), mode)
    except OSError as problem:
        if problem.errno in (errno.ELOOP, errno.ENXIO, errno.EMLINK):
            raise OSError(problem.errno, NOT_REGULAR, str(path)) from None
        raise
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise OSError(errno.EINVAL, NOT_REGULAR, str(path))
    return descriptor


def _is_regular(path: Path) -> bool:
    """Whether a regular file has this name; a link to one is not one."""
    return os.path.lexists(path) and stat.S_ISREG(path.lstat().st_mode)


def read_private(path: Path) -> bytes:
    """Read a regular file of the state folder. Raises OSError."""
    with open(open_private(path), "rb") as file:
        return file.read()


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
    """Make new names survive a power cut. Raises OSError where the disk fails; some disks have no such call."""
    if sys.platform == "win32":
        return
    try:
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
    except OSError as problem:
        if problem.errno not in UNABLE:
            raise
