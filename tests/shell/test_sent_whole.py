"""A line is sent whole or refused unsent: in every language, from every front end, whatever a person types.

What reaches the wire holds all that was typed, but for what docs/programs.md lists: blanks at both ends, a TAB that
becomes a blank, and the item by which a print is known again.
"""

from __future__ import annotations

import asyncio
import re
from dataclasses import replace
from random import Random

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic, DriveError, Inexpressible
from multidrop.dialects.codec import Procedure, Request
from multidrop.dialects.families import FAMILIES
from multidrop.families.lexium.host.modbus.codec import Modbus, ModbusState
from multidrop.families.lexium.manual.grammar import Number, parsed
from multidrop.families.tmcl.manual import commands
from multidrop.macros import Macro, MacroStep
from multidrop.shell.events import By
from multidrop.shell.line_syntax import DriveLine, parse
from multidrop.shell.origin import PERSON
from multidrop.shell.scripts.executor import play, run_script
from multidrop.shell.scripts.reading import read_script
from tests.support.cases import for_each
from tests.support.cell_session import CellSession, bus, drive, party, pmx

MODULE = 'personality = "TMCM"\nname = "1"'
CELL = (
    bus("press", party("a"), party("b", EM=2, CK=0)), bus("alone", drive("LMDCM")), bus("stages", pmx("00")),
    bus("lab", MODULE),
)  # fmt: skip
CUT = {
    "@press:a": ("MA 51\\200", "RC=2\\5", "MA 51'200", "MR 51`200", "MR 5 'far", "MR 5 \\far", "'MR 5", "\\MR 5",
                 "PR 'a'", "PR P `", "MR 5^M", "MR 5^J", "MR 5^M^J", "R1=R2^M", "MR 5 # far", "# MR 5", "MR 5\x1f",
                 "MR 5\u00a0", "\u3000MR 5", "MR 5\x0b", "MR \uff15\uff11", "MR \u221251", "MR 51\u202f200", "DN='a'"),
    "@press:b": ("MA 51\\200", "RC=2\\5", "MR 5'far", "MR 5^M", "MR 5 # far"),
    "@press:*": ("SL 51\\200", "MA 5 'far", "MR 5^M", "MR 5 # far"),
    "@alone:": ("MA 51\\200", "RC=2\\5", "MR 5`far", "MR 5^J", "MR 5 # far"),
    "@stages:00": ("X51;200", "X1000 ;far", "ABS;", "SA0=X51;200", "X51`200", "X51\\200",
                   "X5^M", "X5 # far", "X5\u00a0"),
    "@lab:1": ("MVP ABS, 0, 51;200", "MVP ABS, 0, 51//200", "MST 0 ;far", "MST 0 // far", "MST 0^M",
               "MST 0 # far",
               "MVP ABS, 0, 51\u00a0", "MVP ABS, 0, \uff15\uff11", "MVP ABS, 0, \u221251", "MVP ABS, 0, 5_1",
               "MST 0.5"),
}  # fmt: skip


def _lines() -> list[str]:
    return [f"{at} {text}" for at, texts in CUT.items() for text in texts]


@pytest.mark.virtual
async def test_what_would_be_cut_is_refused_and_nothing_is_sent(tmp_path) -> None:
    async with CellSession(tmp_path, *CELL) as shop:
        await asyncio.sleep(1.0)
        shop.events.clear()
        for line in _lines():
            for by in (By.OPERATOR, By.SCRIPT):
                with pytest.raises(DriveError) as caught:
                    await shop.session.run(line, replace(shop.session.origin, by=by))
                assert isinstance(caught.value, Inexpressible) and "\n" not in str(caught.value), line
        sent = [shop.written(name) for name in ("press", "alone", "stages", "lab")]
        assert sent == [b"", b"", b"", b""]


@pytest.mark.virtual
async def test_no_question_is_asked_for_a_line_that_is_not_sent(tmp_path) -> None:
    async with CellSession(tmp_path, *CELL) as shop:
        shop.session.questions.agreed = False
        for line in ("@press:a FD 'all", "@press:* SL 5`", "@stages:00 STORE;"):
            with pytest.raises(Inexpressible):
                await shop.session.run(line)


@pytest.mark.virtual
async def test_a_script_and_a_macro_are_refused_before_their_first_line(tmp_path) -> None:
    async with CellSession(tmp_path, *CELL) as shop:
        await asyncio.sleep(1.0)
        shop.events.clear()
        for wrong in (each for each in _lines() if each.isascii() and each.isprintable() and " #" not in each):
            (tmp_path / "s.txt").write_text(f"@press:a MR 51200\n{wrong}\n", encoding="utf-8")
            with pytest.raises(Diagnostic, match=r"s.txt:2: "):
                await run_script(shop.session, PERSON, read_script(str(tmp_path / "s.txt"), {}))
            with pytest.raises(Diagnostic, match="go, step 2: "):
                await play(
                    shop.session,
                    PERSON,
                    Macro("go", (MacroStep(0.0, "@press:a MR 51200"), MacroStep(0.0, wrong))),
                    {},
                )
        with pytest.raises(Diagnostic, match="go, step 2: .*# begins a comment"):
            await play(
                shop.session,
                PERSON,
                Macro("go", (MacroStep(0.0, "@press:a MR 51200"), MacroStep(0.0, "@press:a MR 5 # x"))),
                {},
            )
        value = read_script(str(_written(tmp_path, "@press:a MR 51200\n@press:a MR {FAR}\n")), {"FAR": "51\\200"})
        with pytest.raises(Diagnostic, match="51\\\\200 would be read as 51; write 51200"):
            await run_script(shop.session, PERSON, value)
        await asyncio.sleep(1.0)
        assert b"MR" not in shop.written("press")


def _written(folder, text):
    (folder / "v.txt").write_text(text, encoding="utf-8")
    return folder / "v.txt"


@pytest.mark.virtual
async def test_a_script_sends_a_text_with_a_number_sign_whole(tmp_path) -> None:
    async with CellSession(tmp_path, *CELL) as shop:
        await run_script(
            shop.session,
            PERSON,
            read_script(str(_written(tmp_path, '@press:a PR "part # 5" # six\n')), {}),
        )
        assert shop.printed() == ["part # 5"]


@for_each("line", ["MA 51\\200", "RC=2\\5", "MR 5 'far", "MR 5^M"])
def test_the_commands_refuse_it(multidrop, line: str) -> None:
    sent = multidrop("send", "sim:#press", f"@a {line}", "@a R1=5")
    assert sent.returncode == 1 and "nothing was sent" in sent.stderr and len(sent.stderr.splitlines()) == 1
    piped = multidrop("send", "sim:#press", "@a PR P")
    assert piped.stdout == "0\n"


TYPED = st.text(
    st.sampled_from("MRXSP =5120,'`\\;#/^MJ\"~-+.&_\t\u00a0\uff15\u2212é\x1f") | st.characters(), max_size=16
)


def _first(procedure: Procedure[tuple[str, ...]]) -> Request | None:
    try:
        return next(procedure)
    except StopIteration:
        return None


def _spaced(text: str) -> str:
    """What is typed, with what the documentation says of blanks."""
    parts = text.strip(" \t\r\n").split('"')
    return '"'.join(part if at % 2 else part.replace("\t", " ") for at, part in enumerate(parts)).strip(" ")


@pytest.mark.parametrize("name", ["mcode", "pmx", "tmcl", "modbus"])
@given(text=TYPED)
@example(text="MA 51\\200")
@example(text="MR 5 'x")
@example(text="X51;200")
@example(text="MVP ABS, 0, 51")
@example(text="RC=51")
@example(text="MR 5\u00a0")
def test_any_typed_text_is_sent_whole_or_refused(name: str, text: str) -> None:
    family = FAMILIES[name]
    state = (
        ModbusState(Modbus()) if name == "modbus" else family.new_state(family.codec, "00" if name == "pmx" else "1")
    )
    try:
        line = parse(text)
        if not isinstance(line, DriveLine) or line.address is not None:
            return
        family(state).check_line(line.text)
        request = _first(family(state).perform(line.text))
    except (DriveError, Diagnostic) as error:
        assert "\n" not in str(error).replace(text.strip(), "")
        return
    if request is None or request.text not in (line.text, _spaced(line.text)):
        return  # multidrop's own question before it, or a print of Modbus that the host puts together
    typed, stripped = _spaced(text), text.strip(" \t\r\n")
    if name == "mcode":
        assert typed.encode("ascii").rstrip(b"; ") in request.codec.encode(request)
    elif name == "pmx":
        assert request.codec.encode(request) == f"@00{stripped}\r".encode("ascii")
    elif name == "tmcl":
        assert re.findall(r"\w+", typed.upper()) and commands.parse(typed) == commands.parse(str(commands.parse(typed)))
        numbers = [int(each) for each in re.findall(r"[+-]?\d+", typed)]
        assert [*map(int, re.findall(r"[+-]?\d+", str(commands.parse(typed))))][-len(numbers) or 9 :] == numbers
    else:
        statement = parsed(typed)
        assert statement is not None and not re.search("['`\\\\]", re.sub('"[^"]*"', "", typed))
        if len(statement.arguments) == 1 and isinstance(number := statement.arguments[0], Number):
            assert str(number.value) in re.sub(r"\b0+(?=\d)", "", typed)


def test_many_texts_of_words_are_sent_whole_or_refused() -> None:
    """As above, of words that the languages have, so that most lines are sent."""
    rng = Random(4)
    words = ("MA", "MR", "R1=", "RC=", "PR ", "P", '"a', '"', "X", "HSPDX=", "MVP ABS, 0,", "SAP 4, 0,", " ", "\t",
             "51", "200", "'", "`", "\\", ";", "#", " #", "^M", "//", ",", ".", "-", "_", "\u00a0", "x")  # fmt: skip
    sent = 0
    for _ in range(6000):
        text = "".join(rng.choices(words, k=rng.randrange(1, 7)))
        for name in ("mcode", "pmx"):
            family = FAMILIES[name]
            state = family.new_state(family.codec, "00" if name == "pmx" else "a")
            try:
                line = parse(text)
                if not isinstance(line, DriveLine) or line.address is not None:
                    continue
                family(state).check_line(line.text)
                request = family.codec.request(state.address, line.text)  # type: ignore[attr-defined]
            except (DriveError, Diagnostic):
                continue
            sent += 1
            assert _spaced(text).encode("ascii") in request.codec.encode(request), text
    assert sent > 2000
