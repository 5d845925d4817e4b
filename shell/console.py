r"""A console of Windows in the form of a terminal: bytes as they are typed, text that is shown, and its end.

Windows gives records of keys. `KeyBytes` makes of them the bytes that a terminal sends, so all that takes keys is the
same on every system. The rest is a thin layer over the system's calls: `Console` reads in a thread of its own, `writer`
shows UTF-8 whatever the code page is, `end_with_console` makes a console that is closed an early end.
"""

from __future__ import annotations

import os
import sys
from codecs import getincrementaldecoder
from collections.abc import Callable, Iterable, Mapping
from types import TracebackType
from typing import Any, NamedTuple

SHIFT, ALT, RIGHT_ALT, LEFT_ALT, CONTROL = 0x10, 0x03, 0x01, 0x02, 0x0C
"""Bits of the keys that are held with another one."""
MENU = 0x12
"""The Alt key: released, it gives the character whose number was typed."""
LETTERS = {0x26: "A", 0x28: "B", 0x27: "C", 0x25: "D", 0x24: "H", 0x23: "F"}
"""Cursor keys, Home and End."""
FIRST_FOUR = dict(zip(range(0x70, 0x74), "PQRS", strict=True))
NUMBERED = {0x2D: 2, 0x2E: 3, 0x21: 5, 0x22: 6} | dict(
    zip(range(0x74, 0x7C), (15, 17, 18, 19, 20, 21, 23, 24), strict=True)
)
"""Insert, Delete, Page Up, Page Down, F5 to F12."""
PLAIN = {(0x08, "\b"): "\x7f", (0x08, "\x7f"): "\b"}
"""Backspace, which a terminal sends as DEL, and Ctrl+Backspace."""
X, TAB = 0x58, 0x09
STOP = "\x18"


class KeyRecord(NamedTuple):
    """The record of a key: its code, the UTF-16 unit that it gives (NUL: none), and the bits of the keys held."""

    pressed: bool
    code: int
    character: str = "\0"
    held: int = 0
    repeats: int = 1


def text_of(key: KeyRecord) -> str:
    """Return what a terminal sends for a key; empty for one that is released, or that gives nothing."""
    _, code, character, held, _ = key
    control, alt = bool(held & CONTROL), bool(held & ALT)
    if not key.pressed:
        return character if code == MENU and character != "\0" else ""
    if character != "\0":
        if code == TAB and held & SHIFT:
            return "\x1b[Z"
        text = PLAIN.get((code, character), character)
        return f"\x1b{text}" if code and alt and not control else text  # with Control it is AltGr; 0: a sequence
    if code == X and control and not alt:  # a layout of keys without that letter
        return STOP
    number = 1 + bool(held & SHIFT) + 2 * alt + 4 * control
    if code in LETTERS:
        return f"\x1b[1;{number}{LETTERS[code]}" if number > 1 else f"\x1b[{LETTERS[code]}"
    if code in FIRST_FOUR:
        return f"\x1b[1;{number}{FIRST_FOUR[code]}" if number > 1 else f"\x1bO{FIRST_FOUR[code]}"
    if code in NUMBERED:
        return f"\x1b[{NUMBERED[code]};{number}~" if number > 1 else f"\x1b[{NUMBERED[code]}~"
    return ""


class KeyBytes:
    """Makes the bytes of a terminal of records, and keeps half a character for the next one."""

    def __init__(self) -> None:
        self._decoder = getincrementaldecoder("utf-16-le")("replace")

    def take(self, keys: Iterable[KeyRecord]) -> bytes:
        text = "".join(text_of(key) * max(1, key.repeats) for key in keys)
        return self._decoder.decode(text.encode("utf-16-le", "surrogatepass")).encode()


def whole_characters(data: bytes, most: int) -> bytes:
    """Return the first bytes of UTF-8, at most as many, without a part of a character at their end."""
    piece = data[:most]
    while len(piece) < len(data) and data[len(piece)] & 0xC0 == 0x80 and piece:
        piece = piece[:-1]
    return piece or data[:most]


SWALLOWS = 22000
"""The first build of Windows whose console passes on every control key through OpenSSH."""


def may_swallow(build: int, environment: Mapping[str, str]) -> bool:
    """True if a console of this build is reported to swallow Ctrl+X: one that OpenSSH has made."""
    return build < SWALLOWS and "SSH_CONNECTION" in environment


def swallows() -> bool:
    """True if the console of this process is reported to swallow Ctrl+X."""
    return sys.platform == "win32" and may_swallow(version()[2], os.environ)


if sys.platform == "win32":
    import _thread
    import ctypes
    import msvcrt
    import signal
    import threading
    from ctypes import wintypes

    _kernel = ctypes.WinDLL("kernel32", use_last_error=True)
    _kernel.CreateEventW.restype = wintypes.HANDLE
    _kernel.OpenProcess.restype = wintypes.HANDLE
    FIRST, NOTHING = 0, 0x102
    """What a wait returns for the first handle, and for none in time."""
    LOOK = 500
    """The time between two looks for a console that is gone without a word, ms."""
    RECORDS = 512
    """The records of one read."""
    KEY, SIZE = 1, 4
    """The kinds of records that count."""
    PROCESSED, WINDOW, EXTENDED, TERMINAL_INPUT = 0x1, 0x8, 0x80, 0x200
    """Ctrl+C as an event; changes of the size; no selection by the mouse, which swallows the next key; sequences."""
    PROCESSED_OUTPUT, WRAPS, TERMINAL_OUTPUT = 0x1, 0x2, 0x4
    CLOSE, LOGOFF, SHUTDOWN = 2, 5, 6
    TO_END = 4.5
    """Seconds that the process has for its end: Windows ends it after five."""
    PIPE_CLOSED = 4
    QUERY, SYNCHRONIZE, DENIED = 0x1000, 0x100000, 5

    class _KeyRecord(ctypes.Structure):
        _fields_ = (
            ("pressed", wintypes.BOOL),
            ("repeats", wintypes.WORD),
            ("code", wintypes.WORD),
            ("scan", wintypes.WORD),
            ("character", wintypes.WCHAR),
            ("held", wintypes.DWORD),
        )

    class _Record(ctypes.Structure):
        _fields_ = (("kind", wintypes.WORD), ("key", _KeyRecord))

    def _handle(descriptor: int) -> wintypes.HANDLE:
        return wintypes.HANDLE(msvcrt.get_osfhandle(descriptor))

    def _mode(descriptor: int) -> int | None:
        """The mode of a console; None: the descriptor leads to none."""
        mode = wintypes.DWORD()
        try:
            return mode.value if _kernel.GetConsoleMode(_handle(descriptor), ctypes.byref(mode)) else None
        except (OSError, ValueError):
            return None

    def version() -> tuple[int, int, int]:
        """The version of Windows and its build. Python's own is that of a library, or what a manifest asks for."""
        record = (wintypes.ULONG * 71)(284)  # OSVERSIONINFOEXW, which begins with its size
        ctypes.WinDLL("ntdll").RtlGetVersion(record)
        return record[1], record[2], record[3]

    def is_console(descriptor: int) -> bool:
        return _mode(descriptor) is not None

    class Console:
        """The keys of the console of a descriptor. `came` and `resized` are called in the reading thread.

        `came` gets the bytes of each read, empty at the end of the input. `signals`: Ctrl+C stays an event.
        """

        def __init__(
            self, descriptor: int, came: Callable[[bytes], None], resized: Callable[[], None], signals: bool
        ) -> None:
            self._descriptor, self._came, self._resized, self._signals = descriptor, came, resized, signals
            self._before: dict[int, int] = {}
            self._over = wintypes.HANDLE(_kernel.CreateEventW(None, True, False, None))
            self._thread = threading.Thread(target=self._run, daemon=True, name="keyboard")

        def __enter__(self) -> Console:
            for descriptor in {self._descriptor, 1, 2}:
                if (mode := _mode(descriptor)) is not None:
                    self._before[descriptor] = mode
            wanted = WINDOW | EXTENDED | (PROCESSED if self._signals else 0)
            if not _kernel.SetConsoleMode(_handle(self._descriptor), wanted | TERMINAL_INPUT):
                _kernel.SetConsoleMode(_handle(self._descriptor), wanted)
            for descriptor in self._before.keys() - {self._descriptor}:
                _kernel.SetConsoleMode(_handle(descriptor), PROCESSED_OUTPUT | WRAPS | TERMINAL_OUTPUT)
            self._thread.start()
            return self

        def __exit__(
            self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
        ) -> None:
            self.end()
            for descriptor, mode in self._before.items():
                _kernel.SetConsoleMode(_handle(descriptor), mode)

        def end(self) -> None:
            """End the reading; the console stays as it is until this is left."""
            _kernel.SetEvent(self._over)
            self._thread.join()

        def more(self) -> bool:
            """True if records wait to be read."""
            return bool(_kernel.WaitForSingleObject(_handle(self._descriptor), 0) == FIRST)

        def _run(self) -> None:
            console, keys = _handle(self._descriptor), KeyBytes()
            both = (wintypes.HANDLE * 2)(self._over, console)
            records, count = (_Record * RECORDS)(), wintypes.DWORD()
            while (ready := _kernel.WaitForMultipleObjects(2, both, False, LOOK)) != FIRST:
                if ready == NOTHING and _kernel.GetNumberOfConsoleInputEvents(console, ctypes.byref(count)):
                    continue  # it is there
                if ready != FIRST + 1 or not _kernel.ReadConsoleInputW(console, records, RECORDS, ctypes.byref(count)):
                    self._came(b"")
                    return
                taken = records[: count.value]
                pressed = (record.key for record in taken if record.kind == KEY)
                data = keys.take(
                    KeyRecord(bool(record.pressed), record.code, record.character, record.held, record.repeats)
                    for record in pressed
                )
                if data:
                    self._came(data)
                if any(record.kind == SIZE for record in taken):
                    self._resized()

    def writer(descriptor: int, chunk: int) -> Callable[[bytes], int] | None:
        """Return what writes UTF-8 to a console and returns the number of bytes; None: the descriptor leads to none."""
        if not is_console(descriptor):
            return None
        console: Any = open(descriptor, "wb", buffering=0, closefd=False)  # noqa: SIM115 - lives as long as the process
        return lambda data: int(console.write(whole_characters(data, chunk)) or 0)

    def _ended(event: int) -> bool:
        """Make the end of the console a signal, and give the process the time to end by itself."""
        if event not in (CLOSE, LOGOFF, SHUTDOWN) or not callable(signal.getsignal(signal.SIGBREAK)):
            return False
        _thread.interrupt_main(signal.SIGBREAK)
        threading.Event().wait(TO_END)
        return True

    _on_end = ctypes.WINFUNCTYPE(wintypes.BOOL, wintypes.DWORD)(_ended)

    def end_with_console() -> None:
        """Send SIGBREAK to this process where its console is closed, or its person logs off; for its whole life.

        Windows sends it for Ctrl+Break itself. It is never taken back: that would wait for a call that is under way.
        """
        _kernel.SetConsoleCtrlHandler(_on_end, True)

    def reader_gone(descriptor: int) -> bool:
        """True if the other end of a pipe is closed."""
        status, facts = (ctypes.c_void_p * 2)(), (wintypes.ULONG * 10)()
        query = ctypes.WinDLL("ntdll").NtQueryInformationFile
        failed = query(_handle(descriptor), status, facts, ctypes.sizeof(facts), 24)  # FilePipeLocalInformation
        return not failed and facts[8] == PIPE_CLOSED  # NamedPipeState

    def runs(pid: int) -> bool:
        """True if a process runs, as far as the system shows."""
        process = wintypes.HANDLE(_kernel.OpenProcess(SYNCHRONIZE | QUERY, False, pid))
        if not process:
            return ctypes.get_last_error() == DENIED
        ended = _kernel.WaitForSingleObject(process, 0) == FIRST
        _kernel.CloseHandle(process)
        return not ended

    def facts() -> list[str]:
        """What a report names: the build of Windows, the host of the console, and its code pages."""
        host = "Windows Terminal" if "WT_SESSION" in os.environ else "console"
        host = f"{host}, made by OpenSSH" if "SSH_CONNECTION" in os.environ else host
        pages = (
            f"code pages {_kernel.GetConsoleCP()} in, {_kernel.GetConsoleOutputCP()} out, {_kernel.GetACP()} of files"
        )
        return [f"Windows {'.'.join(map(str, version()))}; {host}; {pages}"]
