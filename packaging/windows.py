"""Build a CPython for Windows with the pinned packages in .venv/windows, and run the tests for Windows under Wine.

The interpreter's libraries and the packages come out of the package index that pip asks, the standard library is this
Python's own. Nothing is built twice. Not for Windows itself: there `python -m pytest` does it (docs/windows.md).

Run: python packaging/windows.py [ARGUMENTS OF PYTEST]    (make windows)
     python packaging/windows.py --python ARGUMENTS       any command of that Python
"""

from __future__ import annotations

import math
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import zipfile
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parent.parent
HOME = ROOT / ".venv" / "windows"
PYTHON = HOME / "python"
"""The folder of python.exe."""
PREFIX = HOME / "prefix"
"""What Wine takes for drive C:."""
PORTS = {name: HOME / "ports" / name for name in ("COM5", "COM6")}
"""The COM ports that there are, each a link to a pseudo-terminal, which the test that uses it makes."""
PASSED = ROOT / "tests" / "windows" / "passed"
"""How many tests pass: a run in which fewer do has failed."""
SHARE = 0.85
"""Of the tests of an ordinary run, the part that passes at least."""
SOME_FAILED = 1
"""pytest's exit code: each failure is shown, and the number of those that passed decides."""

CARRIER = "panda3d==1.10.16"
"""A package whose wheel for Windows carries CPython 3.11: its library and its extension modules."""
COMPILER, DUMP = "x86_64-w64-mingw32-gcc", "x86_64-w64-mingw32-objdump"
TOOLS = {"wine": "wine wine64", COMPILER: "gcc-mingw-w64-x86-64-win32", DUMP: "binutils-mingw-w64"}
"""Programs, and the packages of Debian that have them; mingw-w64 has the last two and much more."""
NOT_THERE = ("argparse-manpage", "build", "grimp", "import-linter", "librt", "mypy", "ruff", "ast-serialize")
"""Pinned packages that no test under Windows needs: they check and build, on this side."""
TARGET = ("--platform=win_amd64", "--python-version=311", "--only-binary=:all:", "--no-deps", "-qq")
WINDOWS = {
    "sys_platform": "win32",
    "os_name": "nt",
    "platform_system": "Windows",
    "python_version": "3.11",
    "python_full_version": "3.11.9",
}

MAIN = """
#include <windows.h>
int wmain(int count, wchar_t **words) {
    HMODULE core = LoadLibraryW(L"python311.dll");
    int (*run)(int, wchar_t **) = core ? (void *)GetProcAddress(core, "Py_Main") : 0;
    return run ? run(count, words) : 127;
}
"""
"""python.exe: the wheel has none."""

CHANGED = {
    "serial/tools/list_ports_windows.py": r"^(CM_MapCrToWin32Err)\b.*\n(?:\1\..*\n)*",
    "serial/serialwin32.py": r"not in \(win32\.\w+, win32\.ERROR_IO_PENDING\)|!= win32\.ERROR_OPERATION_ABORTED",
}
CHANGED_TO = {
    "serial/tools/list_ports_windows.py": "CM_MapCrToWin32Err = lambda code, otherwise: otherwise.value\n",
    "serial/serialwin32.py": "not in (0, 995, 997, 1460)",
}
"""Lines of packages that are others for Wine's sake only: a function that its setupapi lacks, and 1460, a time-out,
where Windows says that a read got no bytes."""

RANDOM = """
__declspec(dllimport) unsigned char SystemFunction036(void *, unsigned long);
__declspec(dllexport) int ProcessPrng(void *to, unsigned long long size) { return SystemFunction036(to, size); }
"""
"""bcryptprimitives.dll, which Rust's libraries ask for random bytes. Wine 8 has none."""
MATH, OUR_MATH = b"api-ms-win-crt-math-l1-1-0.dll", b"wine-lacks-crt-math-l1-1-0.dll"
"""Wine's C library has no complex numbers, which numpy takes from it: its name in the libraries becomes ours."""
COMPLEX = r"c(a?(?:cos|sin|tan)h?|exp|log|pow|proj|onj|sqrt|abs|arg|real|imag)([fl]?)"

COMMANDS = (
    ("wineboot", "-i"),
    ("wine", "reg", "add", r"HKCU\Software\Wine", "/v", "Version", "/d", "win10", "/f"),
    *(
        ("wine", "reg", "add", r"HKLM\Software\Wine\Ports", "/v", name, "/d", str(link), "/f")
        for name, link in PORTS.items()
    ),
    ("wineserver", "-w"),  # the next one looks for ports as it starts
)
"""What makes the prefix."""


def main(arguments: list[str]) -> int:
    """Build what is not there; run the tests, or a command."""
    _demand_tools()
    _once("interpreter", CARRIER + MAIN + sys.version, _interpreter)
    pins = _pins()
    _once(
        "packages", "\n".join((CARRIER, *pins, repr((CHANGED, CHANGED_TO, RANDOM, COMPLEX)))), lambda: _packages(pins)
    )
    _once("prefix", repr(COMMANDS), _prefix)
    if arguments[:1] == ["--python"]:
        return _shown(["wine", PYTHON / "python.exe", *arguments[1:]], wine_environment())[0]
    return _tests(arguments)


def _prefix() -> None:
    shutil.rmtree(PREFIX, ignore_errors=True)
    for command in COMMANDS:
        done = subprocess.run(command, env=wine_environment(), capture_output=True, text=True)
        if done.returncode:
            sys.exit(f"make windows: {' '.join(command)} failed: {done.stderr}")


def wine_environment() -> dict[str, str]:
    """What Wine is given: a prefix of its own, no display, no browser, no .NET, and nothing of this Python's."""
    dropped = ("PYTHON", "DISPLAY", "WINE", "TERM", "LS_COLORS")
    return {name: value for name, value in os.environ.items() if not name.startswith(dropped)} | {
        "WINEPREFIX": str(PREFIX),
        "WINEDEBUG": "-all",
        "WINEDLLOVERRIDES": "mscoree,mshtml,winemenubuilder.exe=",
        "PYTHONPYCACHEPREFIX": f"Z:{HOME / 'bytecode'}",
        "MULTIDROP_WINE": "1",  # tests that want what Wine lacks ask for it
    }


def _demand_tools() -> None:
    if missing := [package for tool, package in TOOLS.items() if shutil.which(tool) is None]:
        words = " ".join(missing)
        if os.geteuid() or shutil.which("apt-get") is None:
            sys.exit(f"make windows: wine and mingw-w64 are not complete: install them (apt-get install {words})")
        for command in (["update", "-q"], ["install", "-y", "-q", "--no-install-recommends", *words.split()]):
            done = subprocess.run(["apt-get", *command], stdout=subprocess.DEVNULL)
            if done.returncode:
                sys.exit(f"make windows: apt-get {' '.join(command)} failed")


def _once(name: str, made_from: str, make: Callable[[], object]) -> None:
    """Make a part, unless it was made from the same."""
    stamp, mark = HOME / f"{name}.made", f"{zlib.crc32(made_from.encode()):08x}"
    if not stamp.exists() or stamp.read_text() != mark:
        print(f"make windows: {name}", flush=True)
        HOME.mkdir(parents=True, exist_ok=True)
        make()
        stamp.write_text(mark)


def _interpreter() -> None:
    """Take the library and the modules from the wheel, the standard library from here; build the two that lack."""
    shutil.rmtree(PYTHON, ignore_errors=True)
    modules = PYTHON / "DLLs"
    modules.mkdir(parents=True)
    _pip("download", f"--dest={HOME / 'wheels'}", CARRIER)
    with zipfile.ZipFile(next((HOME / "wheels").glob("panda3d*.whl"))) as wheel:
        for name in wheel.namelist():
            folder, _, file = name.rpartition("/")
            if folder == "deploy_libs" and file.endswith((".pyd", ".dll")) and not file.startswith("api-ms"):
                beside = file.startswith("python") or file.lower().startswith("vcruntime")
                (PYTHON if beside else modules).joinpath(file).write_bytes(wheel.read(name))
    shutil.rmtree(HOME / "wheels")
    left_out = shutil.ignore_patterns("lib-dynload", "site-packages", "__pycache__", "test", "idlelib", "config-*")
    shutil.copytree(sysconfig.get_path("stdlib"), PYTHON / "Lib", ignore=left_out)
    _compile("python.exe", "python.c", MAIN, "-municode", "-O1")
    dump = subprocess.run([DUMP, "-p", PYTHON / "python311.dll"], capture_output=True, text=True, check=True)
    names = re.findall(r"^\s*\[\s*\d+\](?: \S+)? (_?Py\w+)$", dump.stdout, re.MULTILINE)
    exports = "".join(f"{name} = python311.{name}\n" for name in names)
    _compile("python3.dll", "python3.def", f"LIBRARY python3\nEXPORTS\n{exports}", "-shared", "-nostdlib", "-Wl,-e,0")


def _compile(made: str, source: str, text: str, *flags: str, more: Sequence[str] = ()) -> None:
    (HOME / source).write_text(text)
    subprocess.run([COMPILER, *flags, "-static-libgcc", "-s", "-o", PYTHON / made, HOME / source, *more], check=True)


def _pins() -> list[str]:
    """Return the pinned packages that Windows has, each with its version."""
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    pinned = [each for each in map(Requirement, lines) if each.marker is None or each.marker.evaluate(WINDOWS)]
    return [f"{each.name}{each.specifier}" for each in pinned if each.name not in NOT_THERE]


def _packages(pins: list[str]) -> None:
    """Unzip the wheels of the pinned packages, with the project's own metadata and a path to its checkout."""
    site = PYTHON / "Lib" / "site-packages"
    shutil.rmtree(site, ignore_errors=True)
    (HOME / "pins.txt").write_text("\n".join(pins))
    _pip("install", f"--target={site}", "--no-compile", "-r", str(HOME / "pins.txt"))
    shutil.rmtree(site / "rerun_cli", ignore_errors=True)  # the viewer, a third of all
    (site / "checkout.pth").write_text(f"Z:{ROOT}\n")
    _pip("wheel", f"--wheel-dir={HOME}", str(ROOT), of_windows=False)
    built = next(HOME.glob("multidrop-*.whl"))
    with zipfile.ZipFile(built) as wheel:
        wheel.extractall(site, [name for name in wheel.namelist() if ".dist-info/" in name])
    built.unlink()
    for name, pattern in CHANGED.items():
        text, count = re.subn(pattern, CHANGED_TO[name], (site / name).read_text(), flags=re.MULTILINE)
        assert count, f"{name}: {pattern}"
        (site / name).write_text(text)
    _compile("bcryptprimitives.dll", "random.c", RANDOM, "-shared", more=["-ladvapi32"])
    _complex_numbers(site)


def _complex_numbers(site: Path) -> None:
    """Build a C library of mathematics with complex numbers: the others are passed on to Wine's."""
    names = set()
    for file in (each for kind in ("*.pyd", "*.dll") for each in site.rglob(kind)):
        if MATH in (code := file.read_bytes()):
            imports = subprocess.run([DUMP, "-p", file], capture_output=True, text=True, check=True).stdout
            part = imports.partition(f"DLL Name: {MATH.decode()}")[2].partition("DLL Name: ")[0]
            names |= set(re.findall(r"^\t[0-9a-f]+\t *\d+ +(\w+)$", part, re.MULTILINE))
            file.write_bytes(code.replace(MATH, OUR_MATH))
    code, exports = "#include <complex.h>\n", ""
    code += "typedef struct { float re, im; } F; typedef struct { double re, im; } D;\n"
    value = "__builtin_complex((double){0}.re, (double){0}.im)"
    for name in sorted(names):
        found = re.fullmatch(COMPLEX, name)
        exports += f"{name} = {'ours_' if found else 'ucrtbase.'}{name}\n"
        if found:
            kind, part = ("F", "float") if found[2] == "f" else ("D", "double")
            given = f"{kind} x, {kind} y" if found[1] == "pow" else f"{kind} x"
            call = f"c{found[1]}({', '.join(value.format(each[-1]) for each in given.split(', '))})"
            if found[1] in ("abs", "arg", "real", "imag"):
                code += f"{part} ours_{name}({given}) {{ return {call}; }}\n"
            else:
                body = f"double _Complex z = {call}; return ({kind}) {{ creal(z), cimag(z) }};"
                code += f"{kind} ours_{name}({given}) {{ {body} }}\n"
    (HOME / "math.def").write_text(f"EXPORTS\n{exports}")
    _compile(OUR_MATH.decode(), "math.c", code, "-shared", "-O1", more=[str(HOME / "math.def")])


def _pip(command: str, *arguments: str, of_windows: bool = True) -> None:
    words = [command, *(TARGET if of_windows else ("--no-deps", "-qq")), "--disable-pip-version-check", *arguments]
    subprocess.run([sys.executable, "-m", "pip", *words], check=True)


def _tests(arguments: list[str]) -> int:
    """Run what is done from outside, then the suite; judge how many tests passed."""
    pytest = ["-m", "pytest", "-p", "no:cacheprovider"]
    if arguments:
        return _shown(["wine", PYTHON / "python.exe", *pytest, *arguments], wine_environment())[0]
    outside, _ = _shown([sys.executable, *pytest, "-q", "tests/windows/from_outside.py"], dict(os.environ))
    suite = [*pytest, "-q", "-n", "2", "--dist", "worksteal", "--timeout=400", "--hypothesis-profile=quick"]
    inside, said = _shown(["wine", PYTHON / "python.exe", *suite], wine_environment())
    listed = [sys.executable, *pytest, "-q", "--collect-only"]
    collected = subprocess.run(listed, cwd=ROOT, capture_output=True, text=True)
    passed, of = _number(r"(\d+) passed", said), _number(r"(\d+)(?:/\d+)? tests collected", collected.stdout)
    least = max(int(PASSED.read_text()), math.ceil(SHARE * of))
    if passed < least:
        print(f"make windows: {least} are to pass: {PASSED.relative_to(ROOT)}, and {SHARE:.0%} of {of}")
    elif passed > least:
        print(f"make windows: {PASSED.relative_to(ROOT)} can be {passed}")
    print(f"{passed} passed")
    return int(bool(outside or inside not in (0, SOME_FAILED) or passed < least))


def _shown(command: list[str | Path], environment: dict[str, str]) -> tuple[int, str]:
    """Run a command and show what it prints; return its exit code and the last line."""
    said = ""
    streams: dict[str, Any] = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    with subprocess.Popen(command, cwd=ROOT, env=environment, **streams, text=True, errors="replace") as run:
        for line in run.stdout or ():
            print(line, end="", flush=True)
            said = line.strip() or said
    return run.returncode, said


def _number(pattern: str, text: str) -> int:
    found = re.findall(pattern, text)
    return int(found[-1]) if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
