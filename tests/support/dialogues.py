"""Dialogues in files: calls of a dialect, each request and its bytes, the bytes of each reply, and what comes of them.

A file has blocks of lines. `== ` begins one, with what it shows. `$ ` is a call, or the assignment of one. What follows
it is compared as a whole:

    > 'VM=5' COMMAND b'...'   a request, its fields beside the usual ones, and its bytes as they are sent
    < b'...'                  the reply's bytes; `doubtful` behind them, as a line marks it; `nothing`: time is up
    ! Stopped: ...            the line throws this in place of a reply
      DONE ...                how the codec reads the reply
    = ...                     the value of the call, or `! Refused: ...`, what it raises
    * error: False, True      a field of a drive's state, before and after

`python -m tests.support.dialogues MODULE FILE` writes the file again with the same calls and replies: look at each
change.
"""

from __future__ import annotations

import ast
import enum
import importlib
import sys
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from multidrop.base.errors import Diagnostic, DriveError, Stopped
from multidrop.dialects import End, Reply, Request
from multidrop.dialects.codec import Codec, copy_with
from multidrop.dialects.state import DriveState
from tests.support.procedure import ProcedureRunner

WIDTH = 110
"""A value whose text is longer has a line for each item."""
NOTHING, DOUBTFUL = "nothing", " doubtful"
Replies = Callable[[Request, bytes], str]
"""Returns what stands behind `< ` or, with its `! `, in place of it."""


def shown(value: Any) -> str:
    """Return the text of a value; of a dataclass only fields that differ from their defaults."""
    if isinstance(value, enum.Enum):
        return value.name
    if isinstance(value, type | str | bytes | int | float) or value is None:
        return value.__name__ if isinstance(value, type) else repr(value)
    if isinstance(value, frozenset | set):
        return "{" + ", ".join(sorted(map(shown, value))) + "}"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{shown(key)}: {shown(each)}" for key, each in value.items()) + "}"
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        return f"{type(value).__name__}({', '.join(f'{key}={shown(each)}' for key, each in value._asdict().items())})"
    if isinstance(value, Sequence):
        ends = "[]" if isinstance(value, list) else "()"
        return ends[0] + ", ".join(map(shown, value)) + ends[1]
    if is_dataclass(value) and not isinstance(value, Codec):
        found = [(each.name, getattr(value, each.name)) for each in fields(value) if differs(value, each)]
        return f"{type(value).__name__}({', '.join(f'{name}={shown(each)}' for name, each in found)})"
    if isinstance(value, Codec):
        return repr(value)
    if callable(value):
        return getattr(value, "__name__", type(value).__name__)
    if not hasattr(value, "__dict__"):
        return repr(value)
    return f"{type(value).__name__}({', '.join(f'{name}={shown(each)}' for name, each in vars(value).items())})"


def differs(value: Any, field: Any) -> bool:
    """Whether a field of a dataclass has another value than its default."""
    now = getattr(value, field.name)
    if isinstance(field.default_factory, type | type(lambda: 0)):
        return bool(shown(now) != shown(field.default_factory()))
    return bool(now != field.default) or type(now) is not type(field.default)


def value_lines(value: Any) -> list[str]:
    """The lines that show the value of a call."""
    text = shown(value)
    if len(text) <= WIDTH:
        return [f"= {text}"]
    if isinstance(value, Mapping):
        return [f"=   {shown(key)}: {shown(each)}" for key, each in value.items()]
    if isinstance(value, Sequence) and not isinstance(value, str | bytes) and not hasattr(value, "_asdict"):
        return [f"=   {shown(each)}" for each in value]
    if is_dataclass(value):
        lines = [f"= {type(value).__name__}"]
        for each in fields(value):
            if differs(value, each):
                held = value_lines(getattr(value, each.name))
                lines += [f"=   {each.name}{held[0].removeprefix('=')}" if len(held) == 1 else f"=   {each.name}"]
                lines += [f"=   {line.removeprefix('=')}" for line in held if len(held) > 1]
        return lines
    return [f"= {text}"]


def request_line(request: Request) -> str:
    """The line that shows a request and its bytes."""
    usual = Request(request.address, request.text, request.kind, request.codec, body=request.body)
    more = [
        f"{each.name}={shown(getattr(request, each.name))}"
        for each in fields(request)
        if each.name not in ("tag", "codec") and getattr(request, each.name) != getattr(usual, each.name)
    ]
    data = request.codec.encode(request)
    sent = data.hex() if request.codec.framed else repr(data)
    return " ".join([f"> {request.text!r}", request.kind.name, *more, sent])


def reply_of(request: Request, line: str) -> tuple[Reply, str]:
    """Return the reply that a line of a file gives, and the line that shows how the codec reads it."""
    codec, word = request.codec, line.removesuffix(DOUBTFUL)
    data = bytes.fromhex(word) if codec.framed and word != NOTHING else b""
    if not codec.framed and word != NOTHING:
        data = ast.literal_eval(word)
    found = codec.decode(request, data) or codec.on_quiet(request, data) or codec.on_timeout(request, data)
    reply = found.reply
    read = [reply.end.name]
    read += [
        f"{each.name}={shown(getattr(reply, each.name))}"
        for each in fields(reply)
        if each.name not in ("end", "body", "raw") and differs(reply, each)
    ]
    read += [f"used={found.used}"] if found.used != len(data) else []
    read += [f"strays={found.strays}"] if found.strays else []
    text = "" if read == [End.DONE.name] else "  " + " ".join(read)
    return copy_with(reply, raw=data, doubtful=word != line), text


def conversation(procedure: Generator[Request, Reply, Any], replies: Replies) -> Iterator[str]:
    """Play a conversation; yield its lines."""
    runner = ProcedureRunner(procedure)
    while (request := runner.request) is not None:
        yield request_line(request)
        line = replies(request, request.codec.encode(request))
        if line.startswith("! "):
            yield line
            runner.fail(Stopped(line.removeprefix("! Stopped: ")))
            continue
        yield f"< {line}"
        reply, read = reply_of(request, line)
        if read:
            yield read
        runner.answer(reply)
    yield from value_lines(runner.result)


def states(names: Mapping[str, Any]) -> dict[str, str]:
    """Every field of the states of drives in a block, as texts."""
    held = {name: value for name, value in names.items() if isinstance(value, DriveState)}
    return {
        f"{name}.{field}".removeprefix("it."): shown(each)
        for name, state in held.items()
        for field, each in vars(state).items()
    }


def called(text: str, names: dict[str, Any], replies: Replies) -> Iterator[str]:
    """Carry out the call of a block; yield its lines."""
    yield f"$ {text}"
    before = states(names)
    try:
        node = ast.parse(text).body[0]
        if isinstance(node, ast.Assign | ast.AugAssign | ast.AnnAssign):
            exec(text, names)
            return
        value = eval(text, names)
        if isinstance(value, Generator):
            yield from conversation(value, replies)
        else:
            yield from value_lines(value)
    except (DriveError, Diagnostic, *names.get("ERRORS", ())) as error:
        code = getattr(error, "code", None)
        number = "" if code is None else f" {code}"
        sure = "" if getattr(error, "certain", True) else " uncertain"
        yield f"! {type(error).__name__}{number}{sure}: {'|'.join(str(error).splitlines())}"
    after = states(names)
    for name, now in after.items():
        if name in before and before[name] != now:
            yield f"* {name}: {before[name]}, {now}"


def blocks(text: str) -> dict[str, list[str]]:
    """The blocks of a file by what they show."""
    found: dict[str, list[str]] = {}
    for line in filter(None, text.split("\n")):
        if line.startswith("== "):
            assert line not in found, f"twice: {line}"
            here = found.setdefault(line.removeprefix("== "), [])
        else:
            here.append(line)
    return found


def played(block: Sequence[str], names: Mapping[str, Any]) -> list[str]:
    """Play the calls of a block with its replies; return the lines that it must have."""
    scope, lines = dict(names), list[str]()
    for at, text in enumerate(block):
        if not text.startswith("$ "):
            continue
        end = next((n for n in range(at + 1, len(block)) if block[n].startswith("$ ")), len(block))
        try:
            for line in called(text.removeprefix("$ "), scope, _given(block[at:end])):
                lines.append(line)
        except BaseException as error:
            error.add_note("\n".join([*lines, "written:", *block[at:end]]))
            raise
    return lines


def _given(block: Sequence[str]) -> Replies:
    """Return the replies to the requests of a call, one after the other; behind the last one nothing."""
    given = iter([reply.removeprefix("< ") for asked, reply in pairwise(block) if asked.startswith("> ")])
    return lambda request, sent: next(given, NOTHING)


def written(found: Mapping[str, Sequence[str]]) -> str:
    """The text of a file with these blocks."""
    return "\n".join("\n".join((f"== {title}", *lines, "")) for title, lines in found.items())


def dialogue_tests(folder: Path, names: Mapping[str, Any]) -> dict[str, Callable[[str], None]]:
    """Return a test for each file of dialogues in a folder, with a case for each block; `names`: what the calls use.

    One test of all files would be too long to be among the first that are run on a mutant (`soak.drawn.trial`).
    """
    files = sorted(folder.glob("*.dialogues"))
    return {f"test_a_dialogue_of_{file.stem}_goes_as_it_is_written": _test_of(file, names) for file in files}


def _test_of(file: Path, names: Mapping[str, Any]) -> Callable[[str], None]:
    found = blocks(file.read_text(encoding="utf-8"))

    @pytest.mark.parametrize("title", found)
    def goes_as_it_is_written(title: str) -> None:
        assert played(found[title], names) == found[title]

    return goes_as_it_is_written


def main(module: str, file: str) -> None:
    names, path = vars(importlib.import_module(module)), Path(file)
    found = {title: played(block, names) for title, block in blocks(path.read_text(encoding="utf-8")).items()}
    path.write_text(written(found), encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
