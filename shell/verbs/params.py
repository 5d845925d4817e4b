"""The verb for the settings of drives: keep them in a file, compare them, restore them."""

from __future__ import annotations

import shlex
from collections.abc import Sequence

from multidrop.dialects import Diagnostic
from multidrop.shell.params import work
from multidrop.shell.params.restore import Options
from multidrop.shell.verbs.registry import Call, verb

USAGE = (
    "/params read [ADDR] | save [ADDR] | backup FILE [ADDR] | diff FILE [ADDR] | diff --against ADDR [ADDR] | "
    "diff --defaults [ADDR] | "
    "restore FILE [ADDR] [--dry-run] [--save] [--communication] [--other-product] [--with NAMES]"
)
WORDS = {
    "read": "read all settings, which /page parameters shows",
    "save": "keep the present settings over power-off, after a question",
    "backup": "write all settings to a new file",
    "diff": "print what differs from a file, another drive, or the defaults",
    "restore": "send what differs from a file, after a question",
    "--against": "compare with this drive",
    "--defaults": "compare with the defaults",
    "--dry-run": "show the steps, and send nothing",
    "--save": "keep the settings over power-off",
    "--communication": "restore communication settings too",
    "--other-product": "accept a file of another product",
    "--with": "restore these settings too, which can move the motor: NAME,NAME",
}
FLAGS = ("--dry-run", "--save", "--communication", "--other-product", "--defaults")
VALUES = ("--with", "--against")


def _recorded(call: Call) -> str:
    """The line, with the address of the drive that is selected now."""
    what, options, values, words = _parsed(call)
    names = (
        0 if what in ("read", "save") or what == "diff" and ("--defaults" in options or "--against" in values) else 1
    )
    target = words[names] if len(words) > names else call.workspace.qualified_address(call.drive(""))
    given = [word for pair in values.items() for word in pair]
    return " ".join(("/params", what, *map(shlex.quote, (*words[:names], *filter(None, [target]), *options, *given))))


@verb(USAGE, recorded=_recorded, words=WORDS)
async def params(call: Call) -> None:
    """Read the settings of a drive, keep them in a file, compare them, or restore what differs.

    ADDR may be all: FILE is then a folder with a file for each drive. A restore shows its steps and asks first. It
    leaves alone what can move the motor, unless --with names it.
    """
    what, options, values, words = _parsed(call)
    if what in ("read", "save"):
        if len(words) > 1 or options or values:
            raise call.wrong()
        await (work.read if what == "read" else work.save)(call.workspace, "".join(words))
    elif what == "backup":
        name, target = _file_and_target(call, words)
        work.check_new(call.output_file(name), target)
        await work.backup(call.workspace, name, target)
    elif what == "restore":
        name, target = _file_and_target(call, words)
        await work.restore_each(call.session, name, target, _options(options, values))
    else:
        await _diff(call, options, values, words)


async def _diff(call: Call, options: Sequence[str], values: dict[str, str], words: Sequence[str]) -> None:
    aside = "--defaults" in options or "--against" in values
    if len(words) > 2 - aside or (not aside and not words) or ("--defaults" in options and "--against" in values):
        raise call.wrong()
    name = "" if aside else words[0]
    target = "".join(words[0 if aside else 1 :])
    other = call.drive(values["--against"]) if "--against" in values else None
    await work.diff(call.workspace, target, name=name, other=other)


def _file_and_target(call: Call, words: Sequence[str]) -> tuple[str, str]:
    if not 1 <= len(words) <= 2:
        raise call.wrong()
    return words[0], words[1] if len(words) > 1 else ""


def _options(options: Sequence[str], values: dict[str, str]) -> Options:
    return Options(
        named=frozenset(name.strip().upper() for name in values.get("--with", "").split(",") if name.strip()),
        communication="--communication" in options,
        save="--save" in options,
        dry_run="--dry-run" in options,
        other_product="--other-product" in options,
    )


def _parsed(call: Call) -> tuple[str, list[str], dict[str, str], list[str]]:
    """What to do, the flags, the options with values, and the other words. Raises Diagnostic."""
    what, *rest = call.words(1)
    if what not in ("read", "save", "backup", "diff", "restore"):
        raise call.wrong()
    options: list[str] = []
    values: dict[str, str] = {}
    words: list[str] = []
    left = iter(rest)
    for word in left:
        if word in FLAGS:
            options.append(word)
        elif word in VALUES:
            values[word] = next(left, "")
            if not values[word]:
                raise call.wrong(f"{word} needs a value")
        elif word.startswith("--"):
            raise Diagnostic(f"no option {word}", "/params", f"valid: {', '.join((*FLAGS, *VALUES))}")
        else:
            words.append(word)
    return what, options, values, words
