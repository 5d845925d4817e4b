"""Write the completions for bash, zsh, fish and PowerShell, and the man page from the parser of the command line.

The files are kept in the repository, so that an installation needs neither this program nor its libraries.

Run: python packaging/generate.py        (make shipped)
"""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from unittest import mock

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

import shtab
from argparse_manpage.manpage import Manpage

import multidrop
from multidrop.base.registry import added
from multidrop.cli import build, urls
from multidrop.commands.serving import FILES
from multidrop.shell.connect.scheme import NoLine
from multidrop.shell.connect.schemes import schemes
from multidrop.shell.operations.parameter import Listed

SHIPPED = ROOT / "multidrop" / "shipped"
BRACKETED = re.compile(r"\[(?:[^\[\]]|\[[^\[\]]*\])*\]\S*|\((?:[^()]|\([^()]*\))*\)\S*|\S+")
"""One part of a usage line: an option with its value, a group, or a word."""
USAGE_WIDTH = 77
VALUES = {Listed.URL: "url", Listed.BROKER: "broker", Listed.DRIVE: "drive", Listed.MACRO: "macro"}
"""The list of what completion offers for an argument."""

# Connections, ports and simulated buses; drives of saved connections; macros: listed without a start of Python.
BEGINNINGS = " ".join(
    ["sim:", *(f"'sim:#{bus}'" for bus in ("press", "eth", "pmx"))]
    + [form.prefix for scheme, form in schemes().items() if scheme not in ("sim", "serial")]
)
"""The beginnings of URLs: of a serial port the path is enough."""
BROKERS = [f"{name}://" for each in added(NoLine) for name in each.names]
"""The beginnings of URLs that lead to no drives."""
CONFIG = '"${MULTIDROP_CONFIG_DIR:-${XDG_CONFIG_HOME:-$HOME/.config}/multidrop}'
LISTS = {
    "url": rf"""
  printf '%s\n' {BEGINNINGS}
  for each in /dev/serial/by-id/* /dev/ttyUSB* /dev/ttyACM*; do [ -e "$each" ] && printf '%s\n' "$each"; done
  file={CONFIG}/multidrop.toml"
  [ -r "$file" ] && sed -n 's/^ *\[connections\.\([A-Za-z0-9_][A-Za-z0-9_-]*\)\].*/\1/p' "$file"
""",
    "broker": f"\n  printf '%s\\n' {' '.join(BROKERS)}\n",
    "drive": rf"""
  printf '%s\n' all
  file={CONFIG}/multidrop.toml"
  [ -r "$file" ] && sed -n 's/.*[?&]drives=\([^"&]*\).*/\1/p' "$file" | tr , '\n' | grep -v '^[-=+@]' | sort -u
""",
    "macro": rf"""
  for each in macros/*.toml {CONFIG}/macros"/*.toml; do
    [ -e "$each" ] && printf '%s\n' "${{each##*/}}" | sed 's/[.]toml$//; /^[-=+@]/d'
  done
""",
}
FISH_CONFIG = """
  set -l folder $MULTIDROP_CONFIG_DIR
  test -n "$folder"; or set folder "$XDG_CONFIG_HOME/multidrop"
  test -d "$folder"; or set folder "$HOME/.config/multidrop"
"""
FISH_LISTS = {
    "url": rf"""
  printf '%s\n' {BEGINNINGS}
  find /dev/serial/by-id -type l 2>/dev/null
  find /dev -maxdepth 1 '(' -name 'ttyUSB*' -o -name 'ttyACM*' ')' 2>/dev/null{FISH_CONFIG}
  test -r "$folder/multidrop.toml"; or return
  sed -n 's/^ *\[connections\.\([A-Za-z0-9_][A-Za-z0-9_-]*\)\].*/\1/p' "$folder/multidrop.toml"
""",
    "broker": f"\n  printf '%s\\n' {' '.join(BROKERS)}\n",
    "drive": rf"""
  printf '%s\n' all{FISH_CONFIG}
  test -r "$folder/multidrop.toml"; or return
  sed -n 's/.*[?&]drives=\([^"&]*\).*/\1/p' "$folder/multidrop.toml" | tr , '\n' | grep -v '^[-=+@]' | sort -u
""",
    "macro": rf"""{FISH_CONFIG}
  find macros "$folder/macros" -maxdepth 1 -name '*.toml' 2>/dev/null | sed 's!.*/!!; s/[.]toml$//; /^[-=+@]/d'
""",
}
POWERSHELL_LISTS = {
    "url": rf"""
  {", ".join(f"'{each}'" for each in BEGINNINGS.replace("'", "").split())}
  try {{ [System.IO.Ports.SerialPort]::GetPortNames() }} catch {{ }}
  Select-String -Path (Join-Path (_multidrop_folder) 'multidrop.toml') -ErrorAction SilentlyContinue `
    -Pattern '^ *\[connections\.([A-Za-z0-9_][A-Za-z0-9_-]*)\]' | ForEach-Object {{ $_.Matches[0].Groups[1].Value }}
""",
    "broker": f"\n  {', '.join(map(repr, BROKERS))}\n",
    "drive": r"""
  'all'
  Select-String -Path (Join-Path (_multidrop_folder) 'multidrop.toml') -ErrorAction SilentlyContinue `
    -Pattern '[?&]drives=([^"&]*)' | ForEach-Object { $_.Matches[0].Groups[1].Value -split ',' } |
    Where-Object { $_ -notmatch '^[-=+@]' }
""",
    "macro": r"""
  Get-ChildItem -Path 'macros', (Join-Path (_multidrop_folder) 'macros') -Filter '*.toml' `
    -ErrorAction SilentlyContinue | ForEach-Object { $_.BaseName } | Where-Object { $_ -notmatch '^[-=+@]' }
""",
}
PARTS = {"snapshot": ("apply",)}
"""The parts of commands that run by themselves, too: they are offered beside the URLs, with cell files."""
for _command, _names in PARTS.items():
    _words = " ".join(_names)
    _cells = """  for each in *.toml; do [ -e "$each" ] && printf '%s\\n' "$each"; done"""
    LISTS[_command] = f"\n  printf '%s\\n' {_words}\n{_cells}{LISTS['url']}"
    _cells = "  find . -maxdepth 1 -name '*.toml' 2>/dev/null | sed 's!^[.]/!!'"
    FISH_LISTS[_command] = f"\n  printf '%s\\n' {_words}\n{_cells}{FISH_LISTS['url']}"
    _cells = "  Get-ChildItem -Path '*.toml' -ErrorAction SilentlyContinue | ForEach-Object { $_.Name }"
    _words = ", ".join(f"'{name}'" for name in _names)
    POWERSHELL_LISTS[_command] = f"\n  {_words}\n{_cells}{POWERSHELL_LISTS['url']}"
# bash divides words at colons: they are joined for the parser, and the candidates lose what the line already has.
BASH_WORDS = """
_multidrop() {
  local line="${COMP_LINE:0:COMP_POINT}"
  local COMP_WORDS COMP_CWORD
  read -ra COMP_WORDS <<<"$line"
  [[ "$line" == *[[:space:]] ]] && COMP_WORDS+=("")
  COMP_CWORD=$((${#COMP_WORDS[@]} - 1))
  local word="${COMP_WORDS[COMP_CWORD]}"
  _shtab_multidrop multidrop "$word" "${COMP_WORDS[COMP_CWORD - 1]}"
  if [[ "$word" == *:* && "$COMP_WORDBREAKS" == *:* ]]; then
    COMPREPLY=("${COMPREPLY[@]#"${word%"${word##*:}"}"}")
  fi
  [[ "${COMPREPLY[0]}" == *[:/] ]] && compopt -o nospace 2>/dev/null
  true
}
complete -o bashdefault -F _multidrop multidrop
"""


def listed(kind: str) -> str:
    """The function of bash that prints the values that begin with what is typed."""
    own = (
        """  [[ "$1" == sim:* ]] && compgen -P sim: -f -X '!*.toml' -- "${1#sim:}"\n"""
        if kind in ("url", *PARTS)
        else ""
    )
    return f"""
_multidrop_{kind}s() {{
  local each file{LISTS[kind]}  true
}}
_multidrop_{kind}() {{
  local each
  while IFS= read -r each; do
    [[ "$each" == "$1"* ]] && printf '%s\\n' "$each"
  done < <(_multidrop_{kind}s)
{own}  true
}}
"""


def listed_zsh(kind: str) -> str:
    """The function of zsh that adds the values."""
    return f"""
_multidrop_{kind}() {{
  local each file
  local -a found
  found=(${{(f)"$(setopt localoptions nonomatch; {LISTS[kind].strip()}; true)"}})
  compadd -a found
}}
"""


def listed_powershell(kind: str) -> str:
    """The function of PowerShell that gives the values that begin with what is typed."""
    return f"""
function _multidrop_{kind} {{
  param([string]$WordToComplete)
  @({POWERSHELL_LISTS[kind]}  ) | Where-Object {{ $_ -like "$WordToComplete*" }}
}}
"""


FOLDER = r"""
function _multidrop_folder {
  if ($env:MULTIDROP_CONFIG_DIR) { return $env:MULTIDROP_CONFIG_DIR }
  if ($env:LOCALAPPDATA) { return Join-Path $env:LOCALAPPDATA 'multidrop' }
  if ($env:XDG_CONFIG_HOME) { return Join-Path $env:XDG_CONFIG_HOME 'multidrop' }
  Join-Path $HOME '.config/multidrop'
}
"""
PREAMBLE = {
    "bash": "".join(map(listed, LISTS)),
    "zsh": "".join(map(listed_zsh, LISTS)),
    "fish": "".join(f"\nfunction _multidrop_{kind}{text}  true\nend\n" for kind, text in FISH_LISTS.items()),
    "powershell": FOLDER + "".join(map(listed_powershell, LISTS)),
}
FLAG = "$currentActionIsPositional = $false\n        continue"
FLAG_DONE = """$currentActionIsPositional = $false
        if ($currentActionNargs -eq '0') {
          $currentActionKey = "${prefix}_pos_${completedPositionals}"
          $currentActionNargs = Get-ActionNargs $currentActionKey
          $currentActionIsPositional = $true
        }
        continue"""
"""After a flag of PowerShell's line the next word is a place: shtab takes it for the flag's value."""
SECTIONS = {
    "URLS": [
        *((form.example, form.meaning) for form in schemes().values()),
        ("?KEY=VALUE&...", urls().partition("?: ")[2]),
    ],
    "EXIT STATUS": [
        ("0", "done"),
        ("1", "a drive refused or did not reply, or a check failed"),
        ("2", "wrong usage or unreadable input"),
        ("3", "no connection, or a lost one"),
        ("4", "stopped by a stop"),
        ("130", "interrupted"),
    ],
    "ENVIRONMENT": [
        ("MULTIDROP_CONFIG_DIR", "the folder of the configuration and the macros"),
        ("MULTIDROP_STATE_DIR", "the folder of the history and of what an interrupted session left"),
        ("MULTIDROP_DATA_DIR", "the folder of the backups of programs"),
        ("MULTIDROP_NO_CONFIG", "if set, the configuration is not read, as with --no-config"),
    ],
    "FILES": [("~/.config/multidrop/multidrop.toml", "saved connections: tables [connections.NAME] with a url")],
}


def main() -> None:
    """Write all files."""
    SHIPPED.mkdir(exist_ok=True)
    for name, text in files().items():
        (SHIPPED / name).write_text(text, encoding="utf-8")


def files() -> dict[str, str]:
    """The text of each file, by name."""
    with mock.patch.dict(os.environ, COLUMNS="79"):  # argparse folds usage lines at the width of the terminal
        found = {FILES[shell]: completion(shell) for shell in FILES}
        return found | {"multidrop.1": manual()}


def completion(shell: str) -> str:
    """The completion for one shell."""
    parser = build()
    parser.add_all()
    take_parts(parser)
    for action, command in actions(parser):
        listed = getattr(action, "listed", ())
        kind = next((VALUES[each] for each in listed if each in VALUES), None)
        kind = command.split()[1] if kind == "url" and command.split()[1] in PARTS else kind
        if kind:
            name = f"_multidrop_{kind}"
            action.complete = {**dict.fromkeys(FILES, name), "fish": f"({name})"}  # type: ignore[attr-defined]
        elif Listed.FILE in listed:
            action.complete = shtab.FILE  # type: ignore[attr-defined]
    text = shtab.complete(parser, shell, preamble=PREAMBLE[shell])
    if shell == "powershell":
        assert text.count(FLAG) == 1
        text = text.replace(FLAG, FLAG_DONE)
    return (
        "\n".join(line.rstrip() for line in text.strip().splitlines()) + "\n" + (BASH_WORDS if shell == "bash" else "")
    )


def take_parts(parser: argparse.ArgumentParser) -> None:
    """Give the commands in `PARTS` the options of their parts."""
    commands = next(each for each in parser._actions if isinstance(each, argparse._SubParsersAction)).choices
    for command, names in PARTS.items():
        own = {option for each in commands[command]._actions for option in each.option_strings}
        for name in names:
            part = build([command, name])
            asked = next(each for each in part._actions if isinstance(each, argparse._SubParsersAction))
            group = asked.choices[command]
            group.add_arguments([name])
            inner = next(each for each in group._actions if isinstance(each, argparse._SubParsersAction)).choices[name]
            inner.add_arguments(())
            more = [each for each in inner._actions if each.option_strings and not own & {*each.option_strings}]
            commands[command]._actions.extend(more)


def actions(parser: argparse.ArgumentParser) -> Iterator[tuple[argparse.Action, str]]:
    """All arguments of a parser and of its commands, each with its command."""
    for action in parser._actions:
        yield action, f"{parser.prog} "
        if isinstance(action, argparse._SubParsersAction):
            for part in action.choices.values():
                yield from actions(part)


def manual() -> str:
    """The man page."""
    parser = build()
    parser.add_all()
    for each in (parser, *parts(parser)):
        each.usage = folded_usage(each)
    page = Manpage(parser)
    page.date, page.source, page.manual = "", f"multidrop {multidrop.__version__}", "User commands"
    page.description = "terminal and scripting shell for motion drives"
    return re.sub(r"\n\.SH *\n", "\n", str(page)).rstrip() + "\n" + roff(SECTIONS)


def parts(parser: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    """The parsers of all commands below a parser."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for part in action.choices.values():
                yield part
                yield from parts(part)


def folded_usage(parser: argparse.ArgumentParser) -> str:
    """The usage of a command, folded here: each version of argparse folds it in another way."""
    with mock.patch.dict(os.environ, COLUMNS="10000"):
        usage = parser.format_usage().removeprefix("usage: ").removeprefix(parser.prog).strip()
    head = f"usage: {parser.prog}"
    lines = [head]
    for word in BRACKETED.findall(usage):
        if len(f"{lines[-1]} {word}") > USAGE_WIDTH and len(lines[-1]) > len(head):
            lines.append(" " * len(head))
        lines[-1] += f" {word}"
    return "\n".join(lines).removeprefix("usage: ").replace("%", "%%")


def roff(sections: Mapping[str, Sequence[tuple[str, str]]]) -> str:
    """Sections of terms and their meanings, in the language of man pages."""
    lines = []
    for title, rows in sections.items():
        lines.append(f".SH {title}")
        for term, meaning in rows:
            lines += [".TP", f"\\fB{escaped(term)}\\fR", escaped(meaning)]
    return "\n".join(lines) + "\n"


def escaped(text: str) -> str:
    """Text that man prints as it is."""
    return text.replace("\\", r"\e").replace("-", r"\-")


if __name__ == "__main__":
    main()
