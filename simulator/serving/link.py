"""The symlink to a pseudo-terminal: held by one server, never in place of a regular file."""

from __future__ import annotations

import fcntl
import os
import sys
from pathlib import Path

from dialects import Diagnostic

assert sys.platform != "win32"


class Link:
    """A link at a path. Raises Diagnostic if another server holds it. `where` names its bus in errors."""

    def __init__(self, path: Path, where: str) -> None:
        self.path, self._where = path, where
        self._lock_path = path.with_name(f".{path.name}.lock")
        self._lock = self._locked()

    def _locked(self) -> int:
        """Hold the link by a lock: the target of a stale link may belong to another program by now."""
        try:
            lock = os.open(self._lock_path, os.O_CREAT | os.O_RDWR | os.O_CLOEXEC, 0o644)
        except OSError as error:
            raise self._cannot(error) from None
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(lock)
            hint = "end the other multidrop sim, or use another path"
            raise Diagnostic(f"{self.path} is served already", self._where, hint) from None
        return lock

    def make(self, device: str) -> None:
        """Create the symlink, replacing a stale one; never overwrite a regular file. Raises Diagnostic."""
        link = self.path
        if not link.is_symlink() and link.exists():
            raise Diagnostic(f"{link} exists and is not a link", self._where, "remove it, or use another path")
        new = link.with_name(f".{link.name}.{os.getpid()}")
        try:
            new.unlink(missing_ok=True)
            new.symlink_to(device)
            new.replace(link)
        except OSError as error:
            raise self._cannot(error) from None

    def remove(self, device: str) -> None:
        """Remove the symlink if it still leads to this device."""
        if self.path.is_symlink() and os.readlink(self.path) == device:
            self.path.unlink(missing_ok=True)

    def release(self) -> None:
        """Let other servers use the link."""
        if self._lock >= 0:
            self._lock_path.unlink(missing_ok=True)
            os.close(self._lock)
            self._lock = -1

    def _cannot(self, error: OSError) -> Diagnostic:
        return Diagnostic(f"cannot make the link {self.path} ({error.strerror})", self._where)
