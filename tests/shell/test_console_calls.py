"""What is asked of Windows for its console, and what is made of its answers: by a stand-in for its libraries."""

from __future__ import annotations

import ctypes
import importlib.util
import io
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from ctypes import wintypes
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from multidrop.shell import console
from tests.support.cases import for_each

PLACES = {0: 10, 1: 11, 2: 12}
"""The handle of each descriptor."""
OVER = 77
"""The handle of the event that ends the reading."""


class Call:
    """A function whose result is an address: without its type the upper half of one is lost."""

    restype: Any = None

    def __init__(self, does: Callable[..., Any]) -> None:
        self._does = does

    def __call__(self, *given: Any) -> Any:
        assert self.restype is wintypes.HANDLE
        return self._does(*given)


def behind(pointer: Any) -> Any:
    """What a pointer of ctypes points to."""
    return ctypes.cast(pointer, ctypes.POINTER(wintypes.DWORD)).contents


def number(handle: Any) -> int:
    return int(getattr(handle, "value", handle))


class Kernel:
    """A console with its modes, the records that come next, and what was asked of it."""

    def __init__(self) -> None:
        self.modes = {10: 0x1F7, 11: 0x3, 12: 0x3}
        self.refused: set[int] = set()
        """Modes that this console does not know."""
        self.reads: list[list[tuple[int, tuple[Any, ...]]] | None] = []
        """What each read gives; None: it fails."""
        self.gone = False
        self.over = threading.Event()
        self.handler: Any = None
        self.processes: dict[int, bool] = {}
        """Those that can be opened, and whether they have ended."""
        self.closed: list[int] = []
        self.asked: list[Any] = []
        self.CreateEventW, self.OpenProcess = Call(self._event), Call(self._open)

    def _event(self, *given: Any) -> int:
        self.asked.append(given)
        return OVER

    def _open(self, wanted: int, inherited: bool, pid: int) -> int | None:
        self.asked.append((wanted, inherited))
        return 1000 + pid if pid in self.processes else None

    def GetConsoleMode(self, handle: Any, mode: Any) -> int:
        if number(handle) not in self.modes:
            return 0
        behind(mode).value = self.modes[number(handle)]
        return 1

    def SetConsoleMode(self, handle: Any, mode: int) -> int:
        if mode in self.refused:
            return 0
        self.modes[number(handle)] = mode
        return 1

    def SetEvent(self, handle: Any) -> None:
        assert number(handle) == OVER
        self.over.set()

    def WaitForSingleObject(self, handle: Any, time: int) -> int:
        assert time == 0
        if (pid := number(handle) - 1000) in self.processes:
            return 0 if self.processes[pid] else 0x102
        return 0 if self.reads else 0x102

    def WaitForMultipleObjects(self, count: int, handles: Any, every: bool, time: int) -> int:
        assert (count, list(handles), every, time) == (2, [OVER, 10], False, 500)
        if self.reads:
            return 1
        if self.gone:
            return 0x102
        return 0 if self.over.wait(0.001) else 0x102

    def GetNumberOfConsoleInputEvents(self, handle: Any, count: Any) -> int:
        assert number(handle) == 10
        return int(not self.gone)

    def ReadConsoleInputW(self, handle: Any, records: Any, most: int, count: Any) -> int:
        assert most == len(records)
        given = self.reads.pop(0)
        if given is None:
            return 0
        for place, (kind, key) in zip(records, given, strict=False):
            place.kind = kind
            if kind == 1:
                names = ("pressed", "repeats", "code", "scan", "character", "held")
                for name, value in zip(names, key, strict=True):
                    setattr(place.key, name, value)
        behind(count).value = len(given)
        return 1

    def SetConsoleCtrlHandler(self, handler: Any, add: bool) -> None:
        assert add
        self.handler = handler

    def CloseHandle(self, handle: Any) -> None:
        self.closed.append(number(handle))

    def GetConsoleCP(self) -> int:
        return 850

    def GetConsoleOutputCP(self) -> int:
        return 65001

    def GetACP(self) -> int:
        return 1252


class Ntdll:
    """The library of the version, and of the other end of a pipe."""

    state, failed = 3, 0

    def RtlGetVersion(self, found: Any) -> None:
        assert found[0] == 4 * len(found) == 284
        found[1], found[2], found[3] = 10, 0, 19045

    def NtQueryInformationFile(self, handle: Any, status: Any, facts: Any, size: int, what: int) -> int:
        assert (number(handle), size, what) == (11, ctypes.sizeof(facts), 24)
        facts[8] = self.state
        return self.failed


class Windows:
    """The console's module as Windows has it."""

    def __init__(self, module: ModuleType, kernel: Kernel, ntdll: Ntdll) -> None:
        self.module: Any = module
        self.kernel, self.ntdll = kernel, ntdll
        self.came: list[bytes] = []
        self.resizes = 0

    def reading(self, signals: bool = True) -> Any:
        def resized() -> None:
            self.resizes += 1

        return self.module.Console(0, self.came.append, resized, signals)


@pytest.fixture
def windows(monkeypatch: pytest.MonkeyPatch) -> Iterator[Windows]:
    kernel, ntdll = Kernel(), Ntdll()

    def handle(descriptor: int) -> int:
        if descriptor not in PLACES:
            raise OSError(9, "Bad file descriptor")
        return PLACES[descriptor]

    def library(name: str, use_last_error: bool = False) -> object:
        assert use_last_error == (name == "kernel32")
        return {"kernel32": kernel, "ntdll": ntdll}[name]

    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setitem(sys.modules, "msvcrt", SimpleNamespace(get_osfhandle=handle))
    monkeypatch.setattr(ctypes, "WinDLL", library, raising=False)
    monkeypatch.setattr(ctypes, "WINFUNCTYPE", lambda *_: lambda function: function, raising=False)
    monkeypatch.setattr(ctypes, "get_last_error", lambda: 5, raising=False)
    monkeypatch.setattr(signal, "SIGBREAK", signal.SIGUSR2, raising=False)
    spec = importlib.util.spec_from_file_location("console_of_windows", console.__file__)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    made = Windows(module, kernel, ntdll)
    yield made
    made.kernel.over.set()


def key(character: str, code: int = 0x41, *, pressed: int = 1, repeats: int = 1, held: int = 0) -> Any:
    return 1, (pressed, repeats, code, 0, character, held)


def test_a_console_has_modes_for_keys_and_sequences_until_it_is_left(windows: Windows) -> None:
    before = dict(windows.kernel.modes)
    with windows.reading():
        assert windows.kernel.modes == {10: 0x1 | 0x8 | 0x80 | 0x200, 11: 0x7, 12: 0x7}
    assert windows.kernel.modes == before
    assert windows.kernel.asked == [(None, True, False, None)]


def test_without_signals_control_c_is_a_key(windows: Windows) -> None:
    with windows.reading(signals=False):
        assert windows.kernel.modes[10] == 0x8 | 0x80 | 0x200


def test_an_old_console_without_sequences_is_read_all_the_same(windows: Windows) -> None:
    windows.kernel.refused = {0x289}
    with windows.reading():
        assert windows.kernel.modes[10] == 0x89


def test_a_descriptor_that_leads_to_a_file_is_left_alone(windows: Windows) -> None:
    del windows.kernel.modes[12]
    with windows.reading():
        assert 12 not in windows.kernel.modes
    assert [windows.module.is_console(each) for each in (0, 1, 2, 9)] == [True, True, False, False]
    assert windows.module.writer(2, 100) is None


def test_keys_come_as_bytes_and_a_new_size_is_told(windows: Windows) -> None:
    size, focus = (4, ()), (16, ())
    windows.kernel.reads = [
        [key("a"), key("b", repeats=2), key("a", pressed=0)],
        [size],
        [focus, key("\x18", 0x58, held=0x8)],
        [focus],
        [key("c"), size],
    ]
    with windows.reading() as reading:
        while windows.kernel.reads:
            assert reading.more() in (True, False)
    assert windows.came == [b"abb", b"\x18", b"c"]
    assert windows.resizes == 2


def test_more_keys_wait_while_the_console_says_so(windows: Windows) -> None:
    reading = windows.reading()
    assert not reading.more()
    windows.kernel.reads = [[key("a")]]
    assert reading.more()


@for_each("gone", [False, True])
def test_the_end_of_the_input_is_an_empty_read(windows: Windows, gone: Any) -> None:
    windows.came.clear()
    windows.kernel.over.clear()
    windows.kernel.gone = gone
    windows.kernel.reads = [] if gone else [[key("a")], None]
    with windows.reading():
        for thread in threading.enumerate():
            if thread.name == "keyboard":
                assert thread.daemon
                thread.join(5)
    assert windows.came == ([b""] if gone else [b"a", b""])


def test_text_goes_to_the_console_in_whole_characters(windows: Windows, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[tuple[Any, ...]] = []
    shown = io.BytesIO()

    def unbuffered(*given: Any, **more: Any) -> io.BytesIO:
        opened.append((*given, more))
        return shown

    with monkeypatch.context() as patch:
        patch.setattr("builtins.open", unbuffered)
        put = windows.module.writer(1, 5)
    assert opened == [(1, "wb", {"buffering": 0, "closefd": False})]
    assert put("abc\u20acd".encode()) == 3 and shown.getvalue() == b"abc"
    shown.write = lambda data: None  # type: ignore[method-assign,assignment,return-value]
    assert put(b"x") == 0


@for_each(
    "event, handled, ends",
    [(2, 1, True), (5, 1, True), (6, 1, True), (0, 1, False), (1, 1, False), (2, 0, False)],
)
def test_a_console_that_is_closed_interrupts_the_process_and_waits_for_it(
    windows: Windows, monkeypatch: pytest.MonkeyPatch, event: Any, handled: Any, ends: Any
) -> None:
    sent: list[int] = []
    waits: list[float] = []
    monkeypatch.setattr("_thread.interrupt_main", sent.append)
    monkeypatch.setattr(threading.Event, "wait", lambda _, time=None: waits.append(time))
    action = (lambda *_: None) if handled else signal.SIG_DFL
    monkeypatch.setattr(signal, "getsignal", lambda number: action if number == signal.SIGUSR2 else None)
    windows.module.end_with_console()
    assert windows.kernel.handler(event) is ends
    assert (sent, waits) == (([signal.SIGUSR2], [4.5]) if ends else ([], []))


@for_each("state, failed, gone", [(4, 0, True), (3, 0, False), (4, 1, False)])
def test_a_reader_is_gone_once_the_system_calls_its_pipe_closing(
    windows: Windows, state: Any, failed: Any, gone: Any
) -> None:
    windows.ntdll.state, windows.ntdll.failed = state, failed
    assert windows.module.reader_gone(1) is gone


def test_a_process_runs_until_it_has_ended_and_one_of_another_person_is_there(
    windows: Windows, monkeypatch: pytest.MonkeyPatch
) -> None:
    windows.kernel.processes = {5: False, 6: True}
    assert (windows.module.runs(5), windows.module.runs(6), windows.module.runs(7)) == (True, False, True)
    assert windows.kernel.closed == [1005, 1006]
    assert windows.kernel.asked == [(0x101000, False)] * 3
    monkeypatch.setattr(ctypes, "get_last_error", lambda: 87)
    assert not windows.module.runs(7)


@for_each(
    "variables, host, swallows",
    [
        ({}, "console", False),
        ({"WT_SESSION": "1"}, "Windows Terminal", False),
        ({"SSH_CONNECTION": "1"}, "console, made by OpenSSH", True),
    ],
)
def test_a_report_names_the_build_the_console_and_its_code_pages(
    windows: Windows, monkeypatch: pytest.MonkeyPatch, variables: Any, host: Any, swallows: Any
) -> None:
    for name in ("WT_SESSION", "SSH_CONNECTION"):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    pages = "code pages 850 in, 65001 out, 1252 of files"
    assert windows.module.facts() == [f"Windows 10.0.19045; {host}; {pages}"]
    assert windows.module.swallows() is swallows
    assert os.environ.get("WT_SESSION", "") == variables.get("WT_SESSION", "")
