"""What is given twice, or has more digits than are kept, is refused: nothing that a person typed is dropped."""

from __future__ import annotations

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.macros import Macro, MacroStep, checked_values
from multidrop.shell.operations.table import VERBS
from multidrop.shell.scripts import words
from tests.support.cases import for_each
from tests.support.cell_session import CellSession, bus, party

pytestmark = pytest.mark.virtual


@for_each("text", ["/call f.txt x=1 x=2", "/play m x=1 x=2", "/play m --times 2 --times 3", "/play m --fast --fast"])
def test_a_value_of_a_call(text: str) -> None:
    with pytest.raises(Diagnostic, match="is given twice"):
        words.macro_call(text)


@for_each(
    "options",
    [
        ("--set", "a=1", "--set", "a=2"),
        ("--junit", "a.xml", "--junit", "b.xml"),
        ("--role", "a=sim:", "--role", "a=sim:"),
    ],
)
def test_an_option_of_a_command(multidrop, options: tuple[str, ...]) -> None:
    done = multidrop("run", "s.txt", "--on", "sim:", *options)
    assert done.returncode == 2 and "given twice" in done.stderr and len(done.stderr.splitlines()) == 1


def test_options_that_may_be_repeated_are_all_kept(tmp_path, multidrop) -> None:
    (tmp_path / "s.txt").write_text("/print {a} {b}\n")
    assert multidrop("run", "s.txt", "--on", "sim:#press", "--set", "a=1", "--set", "b=2").stdout == "1 2\n"


@for_each(
    ("text", "taken"),
    [("0.1", "0.1"), ("1e3", ""), ("9007199254740993.5", ""), ("0.12345678901234567", ""), ("007.50", "7.5")],
)
def test_a_number_of_a_macro_has_all_its_digits_or_is_refused(text: str, taken: str) -> None:
    macro = Macro("go", (MacroStep(0.0, "R1={N:float}"),))
    if taken:
        assert checked_values(macro, {"N": text}) == {"N": taken}
    else:
        with pytest.raises(Diagnostic):
            checked_values(macro, {"N": text})


async def test_a_description_is_kept_as_it_was_typed(tmp_path) -> None:
    async with CellSession(tmp_path, bus("press", party("a"))) as shop:
        shop.session.macros.save(Macro("go", (MacroStep(0.0, "@a PR P"),)))
        for typed, kept in (('turn  the "left" one', 'turn  the "left" one'), ('"to the left"', "to the left")):
            await shop.session.run(f"/macro describe go {typed}")
            assert shop.session.macros.load("go").note == kept


@for_each("name", sorted({verb.name for verb in VERBS.values()}))
async def test_no_verb_ignores_a_word(tmp_path, name: str) -> None:
    """Words beyond the longest form of a verb are an error, before the verb does anything."""
    if "..." in VERBS[name].usage or name in ("/sim", "/filter", "/units", "/params", "/register", "/coil", "/device"):
        return
    async with CellSession(tmp_path, bus("press", party("a"))) as shop:
        with pytest.raises(Diagnostic):
            await shop.session.run(f"{name} " + " ".join(f"surplus{n}" for n in range(9)))
