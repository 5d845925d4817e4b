"""Write the completions for bash, zsh and fish and the man page from the parser of the command line.

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
from multidrop.cli import build, urls
from multidrop.commands.serving import FILES
from multidrop.shell.connect.url_forms import URL_FORMS

SHIPPED = ROOT / "multidrop" / "shipped"
PATHS = {"FILE", "SCRIPT", "CELL", "FILE.rrd|rerun+http://HOST:PORT/proxy"}
"""The metavars of arguments that are files."""
URL = {"bash": "_multidrop_url", "zsh": "_multidrop_url", "fish": "(_multidrop_url)"}

# Connections, ports and simulated buses, listed without a start of Python.
LIST = r"""
  printf '%s\n' sim: 'sim:#press' 'sim:#eth' 'sim:#pmx' tcp:// udp:// modbus:// rfc2217:// ssh://
  for each in /dev/serial/by-id/* /dev/ttyUSB* /dev/ttyACM*; do [ -e "$each" ] && printf '%s\n' "$each"; done
  file="${MULTIDROP_CONFIG_DIR:-${XDG_CONFIG_HOME:-$HOME/.config}/multidrop}/multidrop.toml"
  [ -r "$file" ] && sed -n 's/^ *\[connections\.\([A-Za-z0-9_-]*\)\].*/\1/p' "$file"
"""
LIST_FISH = r"""
  printf '%s\n' sim: 'sim:#press' 'sim:#eth' 'sim:#pmx' tcp:// udp:// modbus:// rfc2217:// ssh://
  find /dev/serial/by-id -type l 2>/dev/null
  find /dev -maxdepth 1 '(' -name 'ttyUSB*' -o -name 'ttyACM*' ')' 2>/dev/null
  set -l folder $MULTIDROP_CONFIG_DIR
  test -n "$folder"; or set folder "$XDG_CONFIG_HOME/multidrop"
  test -d "$folder"; or set folder "$HOME/.config/multidrop"
  test -r "$folder/multidrop.toml"; or return
  sed -n 's/^ *\[connections\.\([A-Za-z0-9_-]*\)\].*/\1/p' "$folder/multidrop.toml"
"""
BASH = f"""
_multidrop_urls() {{
  local each file{LIST}  true
}}
_multidrop_url() {{
  local each
  while IFS= read -r each; do
    [[ "$each" == "$1"* ]] && printf '%s\\n' "$each"
  done < <(_multidrop_urls)
  [[ "$1" == sim:* ]] && compgen -P sim: -f -X '!*.toml' -- "${{1#sim:}}"
  true
}}
"""
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
ZSH = f"""
_multidrop_url() {{
  local each file
  local -a found
  found=(${{(f)"$(setopt localoptions nonomatch; {LIST.strip()}; true)"}})
  compadd -a found
}}
"""
FISH = f"""
function _multidrop_url{LIST_FISH}  true
end
"""
PREAMBLE = {"bash": BASH, "zsh": ZSH, "fish": FISH}
SECTIONS = {
    "URLS": [
        *((form.example, form.meaning) for form in URL_FORMS.values()),
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
    for action in actions(parser):
        if action.metavar == "URL":
            action.complete = URL  # type: ignore[attr-defined]
        elif action.metavar in PATHS:
            action.complete = shtab.FILE  # type: ignore[attr-defined]
    text = shtab.complete(parser, shell, preamble=PREAMBLE)
    return (
        "\n".join(line.rstrip() for line in text.strip().splitlines()) + "\n" + (BASH_WORDS if shell == "bash" else "")
    )


def actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """All arguments of a parser and of its commands."""
    for action in parser._actions:
        yield action
        if isinstance(action, argparse._SubParsersAction):
            for part in action.choices.values():
                yield from actions(part)


def manual() -> str:
    """The man page."""
    parser = build()
    parser.add_all()
    page = Manpage(parser)
    page.date, page.source, page.manual = "", f"multidrop {multidrop.__version__}", "User commands"
    page.description = "terminal and scripting shell for motion drives"
    return re.sub(r"\n\.SH *\n", "\n", str(page)).rstrip() + "\n" + roff(SECTIONS)


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
