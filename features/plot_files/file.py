"""The file of a plot. A kill loses half a second of new samples, and never anything that the file held before.

Theory of operation. A new `run.rrd` is written in place. An addition to an existing file is written beside it, as
`run.part.rrd`. On close the chunks of both are copied into a new file, which replaces `run.rrd` in one step. A part
that a killed process left is added with the next plot to `run.rrd`. Chunks keep their identities and are copied once
each, so a kill at any point neither loses nor doubles one. (Concatenated recordings would have wrong tables at their
ends.) The file is locked while a plot writes it, where the system has locks.
"""

from __future__ import annotations

import contextlib
import os
import secrets
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from multidrop.base.errors import Diagnostic

if sys.platform != "win32":
    import fcntl

APPLICATION = "multidrop"
FLUSH = 5.0
"""The time of a flush, s, after which the receiver counts as gone."""
SESSION_GAP = 1.0
"""The gap in `elapsed` between old and new samples of a file, s."""
_FULL = 1 << 17
"""The free space below which a disk counts as full, bytes."""


class SinkBroken(Exception):
    """The failure of a plot's file or viewer, in one line for a person."""


class Locked:
    """The file of a plot, which is made if there is none, and locked until `release`."""

    def __init__(self, path: Path) -> None:
        """Open and lock it. Raises Diagnostic."""
        self.path = path
        self._made = not os.path.exists(path)  # Path's own method raises for a name that is too long
        try:
            lock = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        except OSError as error:
            raise Diagnostic(f"cannot write {path} ({error.strerror})") from None
        if sys.platform == "win32":  # an open file is not replaced there: one beside it, which goes with its process
            os.close(lock)
            flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_TEMPORARY
            try:
                lock = os.open(path.with_name(f".{path.name}.lock"), flags)
            except (FileExistsError, PermissionError):
                raise Diagnostic(f"another plot writes {path}", hint="use another file") from None
        else:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                os.close(lock)
                raise Diagnostic(f"another plot writes {path}", hint="use another file") from None
            except OSError:
                pass  # the file system has no locks
        self._lock = lock

    def release(self) -> None:
        """Unlock the file; delete it if this plot made it and wrote nothing. May be called again."""
        if self._lock < 0:
            return
        with contextlib.suppress(OSError):
            if self._made and not self.path.stat().st_size:
                self.path.unlink()
        os.close(self._lock)
        self._lock = -1


class RecordingFile(Locked):
    """One file of a plot. Raises Diagnostic if it cannot be used, and leaves it unchanged then."""

    def __init__(self, rr: Any, path: Path) -> None:
        self._rr = rr
        self.part = path.with_name(f"{path.stem}.part.rrd")
        self.identity = ""
        """The recording in it, which the plot continues; empty: a new file."""
        self.offset = 0.0
        """The value of `elapsed` at which the plot continues, s."""
        self.paths: set[str] = set()
        """The entities in the file."""
        self._good = 0
        super().__init__(path)
        try:
            self._look()
        except Diagnostic:
            self.release()
            raise

    @property
    def adds(self) -> bool:
        return bool(self.identity)

    @property
    def writes(self) -> Path:
        return self.part if self.adds else self.path

    def _look(self) -> None:
        if self.path.stat().st_size:
            self.identity = _identity(self.path)
        if not self.adds:
            return  # new, or left by a plot that was killed before its first sample
        if os.path.exists(self.part):
            if _identity(self.part) not in ("", self.identity):
                raise Diagnostic(f"{self.part} is another recording", hint="rename it")
            try:
                self._join(None)
            except SinkBroken as error:
                raise Diagnostic(f"cannot add {self.part}, which a plot left: {error}") from None
        end = -SESSION_GAP
        for chunk in _chunks(self.path):
            self.paths.add(str(chunk.entity_path))
            if "elapsed" in chunk.timeline_names:
                times = [value.value for value in chunk.to_record_batch().column("elapsed") if value.is_valid]
                end = max(end, max(times, default=-SESSION_GAP * 1e9) / 1e9)
        self.offset = end + SESSION_GAP

    def mark(self) -> None:
        with contextlib.suppress(OSError):
            self._good = self.writes.stat().st_size

    def cut(self) -> None:
        """Remove a message that was written in part, since no reader could pass it; release the file."""
        with contextlib.suppress(OSError):
            if self.writes.stat().st_size > self._good:
                os.truncate(self.writes, self._good)
        self.release()

    def finish(self, blueprint: Any) -> None:
        """Join the closed recording into one file and release it. Raises SinkBroken and keeps both parts."""
        try:
            if self.adds:
                self._join(blueprint)
            else:
                synced(self.path)
        except OSError as error:
            raise SinkBroken(self.why(error)) from None
        finally:
            self.release()

    def _join(self, blueprint: Any) -> None:
        """Copy the file and the part into a new file, which replaces the file."""
        target = Path(os.path.realpath(self.path))
        beside = target.with_name(f".{target.stem}.{secrets.token_hex(4)}.tmp.rrd")
        try:
            _copy(self._rr, (self.path, self.part), beside, self.identity, blueprint)
            synced(beside)
            os.replace(beside, target)
            self.part.unlink()
        except (RuntimeError, OSError) as error:
            raise SinkBroken(self.why(error)) from None
        finally:
            beside.unlink(missing_ok=True)

    def why(self, error: Exception) -> str:
        """The error in words, and where the samples are."""
        reason = str(error)
        if disk_full(self.path.parent):
            reason = "the disk is full"
        kept = f"{self.part} has what was added to {self.path}" if self.adds else "what came before is in it"
        return f"cannot write {self.writes}: {reason}; {kept}"


def _identity(path: Path) -> str:
    """The identity of our recording in the file; empty for an empty file. Raises Diagnostic for other contents."""
    from rerun.chunk import RrdReader

    try:
        reader = RrdReader(str(path))
        recording, layouts = reader.recordings(), reader.blueprints()
    except RuntimeError as error:
        last = str(error).split(": ", 1)[-1]  # the most specific part of rerun's chain of reasons
        raise Diagnostic(f"{path} cannot be added to: {last}", hint="use another file; this one is unchanged") from None
    strange = [entry for entry in (*recording, *layouts) if entry.application_id != APPLICATION]
    if strange or len(recording) > 1 or (layouts and not recording):
        raise Diagnostic(f"{path} is not a plot of multidrop", hint="use another file; this one is unchanged")
    return str(recording[0].recording_id) if recording else ""


def _chunks(path: Path) -> Iterator[Any]:
    from rerun.chunk import RrdReader

    reader = RrdReader(str(path))
    if reader.recordings():
        yield from reader.stream()


def disk_full(folder: Path) -> bool:
    if sys.platform != "win32":
        with contextlib.suppress(OSError):
            room = os.statvfs(folder)
            return room.f_bavail * room.f_frsize < _FULL
    return False


def _copy(rr: Any, sources: tuple[Path, ...], target: Path, identity: str, blueprint: Any) -> None:
    """Write a new file with every chunk of the sources once. Raises RuntimeError, OSError."""
    recording = rr.RecordingStream(APPLICATION, recording_id=identity, send_properties=False)
    recording.set_sinks(rr.FileSink(str(target)))
    seen: set[str] = set()

    def fresh() -> Iterator[Any]:
        for path in sources:
            for chunk in _chunks(path):
                if chunk.id not in seen:
                    seen.add(chunk.id)
                    yield chunk

    try:
        recording.send_chunks(fresh())
        if blueprint is not None:
            recording.send_blueprint(blueprint)
        recording.flush(timeout_sec=60.0)
    finally:
        recording.disconnect()


def synced(path: Path) -> None:
    descriptor = os.open(path, os.O_RDWR)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
