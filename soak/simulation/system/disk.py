"""The disk of the simulated PC: the files of one world, what of them a power cut leaves, and its faults.

The files are real ones of a folder in memory, which is what a process sees and what a kill leaves. Beside them the disk
knows what is durable: the content of a file since its last fsync, the names of a folder since the folder's. A power cut
leaves of each folder's later changes the first few, in their order, and of a file's later content any beginning.

The functions of `os` and `open` are replaced for everybody, and look which process calls: `system.process`.
"""

from __future__ import annotations

import builtins
import contextlib
import errno
import io
import os
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from random import Random
from typing import Any

from soak.simulation.records.climate import Climate
from soak.simulation.system.clock import SimulatedLoop
from soak.simulation.system.process import PROCESS, Killed, Process, operate
from soak.simulation.system.wall import Wall

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

SLOW = 1.0
"""The longest time of an operation on a slow disk, s."""


@dataclass(eq=False)
class Node:
    """A file, or a folder, under whatever names. `kept`: its durable content; `last`: that when its name went."""

    folder: bool = False
    kept: bytes = b""
    last: bytes = b""


@dataclass(eq=False)
class Open:
    """An open descriptor. `file`: Python's object of it, if there is one."""

    process: Process
    path: str
    node: Node | None
    """None: a folder."""
    file: io.FileIO | None = None


@dataclass
class Disk:
    """A disk. Nothing is kept of what the world itself does to it, and no fault meets the world."""

    root: str
    loop: SimulatedLoop
    wall: Wall
    climate: Climate
    rng: Random
    noted: Callable[[str, str], None]
    """Takes each operation that changes something, and its file."""
    open: dict[int, Open] = field(default_factory=dict)
    names: dict[str, Node] = field(default_factory=dict)
    """The files by name, as a process sees them; one that is missing here has not been changed by any."""
    durable: dict[str, Node] = field(default_factory=dict)
    """The files by the names that a power cut leaves."""
    pending: dict[str, list[dict[str, Node | None]]] = field(default_factory=dict)
    """By folder, the changes of its names since it was synced."""
    real: dict[str, Any] = field(default_factory=dict)
    """The functions of `os` that are replaced."""

    # A power cut, a kill

    def cut_power(self, rng: Random) -> None:
        """Leave what is durable, and of the rest what the system may have written by itself."""
        found = {path: self._content(path, node) for path, node in self.names.items() if not node.folder}
        contents = {id(self.names[path]): data for path, data in found.items()}
        for folder in sorted(self.pending):
            changes = self.pending[folder]
            for change in changes[: rng.randrange(len(changes) + 1)]:
                self._change(self.durable, change)
        self.pending.clear()
        for path in sorted(self.names.keys() | self.durable.keys()):
            node = self.durable.get(path)
            if node is not None and self._lost_folder(path):
                del self.durable[path]
                node = None
            if node is None:
                self._remove(path)
            elif not node.folder:
                self._rewrite(path, node, contents.get(id(node), node.last), rng)
            elif not os.path.isdir(path):
                os.mkdir(path)
        self.names = dict(self.durable)

    def _lost_folder(self, path: str) -> bool:
        above = os.path.dirname(path)
        return above in self.names and above not in self.durable

    def _remove(self, path: str) -> None:
        if os.path.isdir(path):
            shutil.rmtree(path)
        elif os.path.lexists(path):
            os.unlink(path)

    def _rewrite(self, path: str, node: Node, now: bytes, rng: Random) -> None:
        """Write the durable content, with a beginning of what was not synced; its end may be zeros."""
        data = node.kept
        if now != data and rng.random() < 0.8:
            size = rng.randrange(len(now) + 1)
            rest = data[size:] if rng.random() < 0.7 else bytes(max(0, len(now) - size))
            data = now[:size] + rest
        node.kept = data
        with open(path, "wb") as file:
            file.write(data)

    def close_all(self, process: Process) -> None:
        """Close the files of a dead process, which gives back its locks."""
        for fd, each in list(self.open.items()):
            if each.process is process:
                del self.open[fd]
                if each.file is not None:
                    io.FileIO.close(each.file)
                else:
                    self.real["close"](fd)

    # Operations

    def _mine(self, path: Any) -> bool:
        """Whether a process of this world names a file of this disk."""
        return PROCESS.get() is not None and isinstance(path, str | os.PathLike) and f"{path}/".startswith(self.root)

    def _fault(self, kind: str, number: int) -> None:
        if self.climate[kind] and self.climate.happens(kind, self.rng):
            self.noted("fault", kind)
            raise OSError(number, os.strerror(number))

    def _operate(self, what: str, path: str, work: Callable[[], Any], part: Callable[[], object] | None = None) -> Any:
        if self.climate["slow disk"] and self.climate.happens("slow disk", self.rng):
            self.loop.hold(self.rng.random() ** 4 * SLOW)

        def noted() -> Any:
            result = work()
            self.noted(what, path)
            return result

        return operate(noted, part, "disk")

    def _changed(self, path: str, change: dict[str, Node | None]) -> None:
        self.pending.setdefault(os.path.dirname(path), []).append(change)
        self._change(self.names, change)

    @staticmethod
    def _change(names: dict[str, Node], change: dict[str, Node | None]) -> None:
        for path, node in change.items():
            if node is None:
                names.pop(path, None)
            else:
                names[path] = node

    def _node(self, path: str) -> Node:
        """The file of a name; one that the world has made is durable."""
        if path not in self.names:
            self.names[path] = self.durable[path] = Node(os.path.isdir(path), self._content(path, None))
        return self.names[path]

    def _content(self, path: str, node: Node | None) -> bytes:
        try:
            with io.FileIO(path) as file:
                return file.readall()
        except OSError:
            return node.last if node is not None else b""

    def _unlinked(self, path: str) -> None:
        node = self._node(path)
        node.last = self._content(path, node)

    # What takes the place of the functions of `os`

    def os_open(self, path: Any, flags: int, mode: int = 0o777, **how: Any) -> int:
        """Open a file or a folder."""
        real = self.real["open"]
        if not self._mine(path):
            return int(real(path, flags, mode, **how))
        name, process = os.path.abspath(path), PROCESS.get()
        assert process is not None

        def work() -> int:
            new = not os.path.lexists(name)
            if new and flags & os.O_CREAT:
                self._fault("disk full", errno.ENOSPC)
            elif not new and not os.path.isdir(name):
                self._node(name)
            fd = int(real(path, flags, mode))
            if new:
                self._changed(name, {name: Node()})
            self.open[fd] = Open(process, name, None if os.path.isdir(name) else self.names[name])
            return fd

        return int(self._operate("open", name, work))

    def os_close(self, fd: int) -> None:
        """Close a descriptor."""
        if fd not in self.open or PROCESS.get() is None:
            return self._guarded("close")(fd)  # type: ignore[no-any-return]

        def work() -> None:
            del self.open[fd]
            self.real["close"](fd)

        operate(work)

    def os_write(self, fd: int, data: Any) -> int:
        """Write to a file; a full disk takes a part of it, or nothing."""
        if fd not in self.open:
            return int(self._guarded("write")(fd, data))

        def write(size: int) -> int:
            taken = int(self.real["write"](fd, bytes(data)[:size]))
            at = self.wall.time_ns()
            os.utime(fd, ns=(at, at))
            return taken

        def work() -> int:
            try:
                self._fault("disk full", errno.ENOSPC)
            except OSError:
                if not (size := self.rng.randrange(len(data) + 1)):
                    raise
                return write(size)
            return write(len(data))

        part = lambda: write(self.rng.randrange(len(data) + 1))  # noqa: E731
        return int(self._operate("write", self.open[fd].path, work, part))

    def os_fsync(self, fd: int) -> None:
        """Make a file's content, or a folder's names, durable."""
        found = self.open.get(fd)
        if found is None:
            return self._guarded("fsync")(fd)  # type: ignore[no-any-return]

        def work() -> None:
            self._fault("fsync refused", errno.EIO)
            if found.node is None:
                for change in self.pending.pop(found.path, ()):
                    self._change(self.durable, change)
            else:
                path = next((path for path, node in self.names.items() if node is found.node), found.path)
                found.node.kept = self._content(path, found.node)

        self._operate("fsync", found.path, work)

    def os_rename(self, source: Any, target: Any, **how: Any) -> None:
        """Give a file another name, which replaces one."""
        if not self._mine(source):
            return self._guarded("rename")(source, target, **how)  # type: ignore[no-any-return]
        old, new = os.path.abspath(source), os.path.abspath(target)

        def work() -> None:
            self._fault("disk full", errno.ENOSPC)
            node = self._node(old)
            if os.path.lexists(new):
                self._unlinked(new)
            self.real["replace"](source, target)
            self._changed(new, {new: node, old: None})

        self._operate("rename", f"{old} {new}", work)

    def os_link(self, source: Any, target: Any, **how: Any) -> None:
        """Give a file one more name."""
        if not self._mine(source):
            return self._guarded("link")(source, target, **how)  # type: ignore[no-any-return]
        old, new = os.path.abspath(source), os.path.abspath(target)

        def work() -> None:
            self._fault("disk full", errno.ENOSPC)
            self.real["link"](source, target)
            self._changed(new, {new: self._node(old)})

        self._operate("link", f"{old} {new}", work)

    def os_unlink(self, path: Any, **how: Any) -> None:
        """Take a name away."""
        if not self._mine(path):
            return self._guarded("unlink")(path, **how)  # type: ignore[no-any-return]
        name = os.path.abspath(path)

        def work() -> None:
            if os.path.lexists(name):
                self._unlinked(name)
            self.real["unlink"](path)
            self._changed(name, {name: None})

        self._operate("unlink", name, work)

    def os_mkdir(self, path: Any, mode: int = 0o777, **how: Any) -> None:
        """Make a folder."""
        if not self._mine(path):
            return self._guarded("mkdir")(path, mode, **how)  # type: ignore[no-any-return]
        name = os.path.abspath(path)

        def work() -> None:
            if not os.path.lexists(name):
                self._fault("disk full", errno.ENOSPC)
            self.real["mkdir"](path, mode)
            self._changed(name, {name: Node(folder=True)})

        self._operate("mkdir", name, work)

    def os_kill(self, number: int, signal: int) -> None:
        """Ask whether a process runs: only the one that asks does."""
        process = PROCESS.get()
        if process is None:
            return self.real["kill"](number, signal)  # type: ignore[no-any-return]
        assert signal == 0
        if number != process.number:
            raise ProcessLookupError(errno.ESRCH, os.strerror(errno.ESRCH))

    def os_getpid(self) -> int:
        """The number of this process."""
        process = PROCESS.get()
        return int(self.real["getpid"]()) if process is None else process.number

    def os_urandom(self, size: int) -> bytes:
        """Bytes by chance."""
        return bytes(self.real["urandom"](size)) if PROCESS.get() is None else self.rng.randbytes(size)

    def open_file(
        self,
        file: Any,
        mode: str = "r",
        buffering: int = -1,
        encoding: str | None = None,
        errors: str | None = None,
        newline: str | None = None,
        closefd: bool = True,
        opener: Any = None,
    ) -> Any:
        """`open`: for files of this disk each write is an operation."""
        if not self._mine(file) and not (isinstance(file, int) and file in self.open):
            return self.real["open_file"](file, mode, buffering, encoding, errors, newline, closefd, opener)
        raw = _File(self, file, mode.replace("b", "").replace("t", ""), closefd)
        buffered: Any = io.BufferedWriter(raw) if raw.writable() else io.BufferedReader(raw)
        return buffered if "b" in mode else io.TextIOWrapper(buffered, encoding or "utf-8", errors, newline)

    def _guarded(self, name: str) -> Callable[..., Any]:
        """A real function, for whoever is not dead."""
        process = PROCESS.get()
        if process is not None and process.dead:
            raise Killed
        return self.real[name]  # type: ignore[no-any-return]

    @contextlib.contextmanager
    def installed(self) -> Iterator[None]:
        """Take the place of the functions of `os`, and of `open`."""
        simulated = {
            "open": self.os_open,
            "close": self.os_close,
            "write": self.os_write,
            "fsync": self.os_fsync,
            "replace": self.os_rename,
            "rename": self.os_rename,
            "link": self.os_link,
            "unlink": self.os_unlink,
            "remove": self.os_unlink,
            "mkdir": self.os_mkdir,
            "kill": self.os_kill,
            "getpid": self.os_getpid,
            "urandom": self.os_urandom,
        }
        plain = [(os, name) for name in ("lseek", "fchmod", "fchown", "truncate", "ftruncate")]
        plain += [(fcntl, "flock")] if fcntl is not None else []
        places: list[tuple[Any, str, Any]] = [(os, name, new) for name, new in simulated.items()]
        places += [(module, name, self._guard(name)) for module, name in plain]
        places += [(builtins, "open", self.open_file), (io, "open", self.open_file)]
        before = [(module, name, getattr(module, name)) for module, name, _ in places]
        self.real = {
            name if module is os else f"{name}_file" if name == "open" else name: old for module, name, old in before
        }
        for module, name, new in places:
            setattr(module, name, new)
        try:
            yield
        finally:
            for module, name, old in before:
                setattr(module, name, old)

    def _guard(self, name: str) -> Callable[..., Any]:
        return lambda *arguments, **how: self._guarded(name)(*arguments, **how)


class _File(io.FileIO):
    """A file whose writes and whose end are operations of a disk."""

    def __init__(self, disk: Disk, file: Any, mode: str, closefd: bool) -> None:
        self._disk = disk
        super().__init__(file, mode, closefd, None if isinstance(file, int) else self._opened)
        if closefd:
            disk.open[self.fileno()].file = self

    def _opened(self, path: str, flags: int) -> int:
        return self._disk.os_open(path, flags, 0o666)

    def write(self, data: Any) -> int:
        """Write bytes, or a part of them."""
        return self._disk.os_write(self.fileno(), bytes(data))

    def close(self) -> None:
        """Close the descriptor, where it is this file's."""
        if not self.closed and self.closefd:
            self._disk.open.pop(self.fileno(), None)
        super().close()
