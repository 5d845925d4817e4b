"""Function-key strings of the vendors' notation, in and out."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic
from multidrop.macros import Macro, MacroStep
from multidrop.macros.vendor import REMARK, exported, imported


def steps(text: str) -> list[tuple[float, str]]:
    (macro,) = imported(text, "keys.txt", ["f9"])
    return [(step.after, step.line) for step in macro.steps]


@pytest.mark.parametrize(
    ("text", "lines"),
    [
        ("F2 MR 51200^M", [(0, "MR 51200")]),
        ("F2 MR 1^M^JPR P^JVM 5^M", [(0, "MR 1"), (0, "PR P"), (0, "VM 5")]),
        ("F2 MR 1^M^p^mPR P^M", [(0, "MR 1"), (1.05, "PR P")]),
        ("F2 ^pMR 1^M^d1250^d250PR P^M", [(1, "MR 1"), (1.5, "PR P")]),
        ("F2 MR 1^M^p^r3", [(0, "MR 1"), (1, "MR 1"), (1, "MR 1"), (0, "/sleep 1")]),
        ("F2 MR 1^M^mMR -1^M^r2^mH^M", [(0, "MR 1"), (0.05, "MR -1"), (0, "MR 1"), (0.05, "MR -1"), (0.05, "H")]),
        ("F2 MR 1^M^f9VM 2^M", [(0, "MR 1"), (0, "/play f9"), (0, "VM 2")]),
        ("F2 ^[^MMR 1^M", [(0, "/stop"), (0, "MR 1")]),
        ("F2 ^C", [(0, "/stop")]),
        ("F2 PR {x}^M", [(0, "PR {{x}}")]),
    ],
)
def test_a_string_becomes_lines_and_pauses(text: str, lines: list[tuple[float, str]]) -> None:
    assert steps(text) == lines


def test_a_day_and_ten_thousand_lines_are_the_most() -> None:
    assert steps("F2 ^d86400000H^M") == [(86400, "H")]
    assert steps("F2 H^M^r10000") == [(0, "H")] * 10_000
    assert steps("F2 H^M^r5000^r2") == [(0, "H")] * 10_000
    for text, says in (
        ("F2 ^d86400001H^M", "keys.txt:1:4: a pause of more than a day"),
        ("F2 ^d86400000^mH^M", "keys.txt:1:14: a pause of more than a day"),
        ("F2 ^d999999999H^M", "keys.txt:1:4: a pause of more than a day"),
        ("F2 H^M^r10001", "keys.txt:1:7: ^r10001 makes more than 10000 lines"),
        ("F2 H^M^r10000H^M", "keys.txt:1:1: more than 10000 lines"),
    ):
        with pytest.raises(Diagnostic) as caught:
            steps(text)
        assert str(caught.value).startswith(says)
    day = Macro("f2", (MacroStep(86400.0, "H"),))
    assert exported([day]) == "F2 ^d86400000H^M\n"
    with pytest.raises(Diagnostic, match="a pause of 86400 s has no counterpart"):
        exported([Macro("f2", (MacroStep(86400.001, "H"),))])


def test_comments_blank_lines_and_keys() -> None:
    text = "; shuttle\r\nF2 MR 1^M ; there ; and back\r\n\n# old\nf12 H^M ;\nF13 PR P^M\n"
    assert imported(text, "keys.txt") == [
        Macro("f2", (MacroStep(0.0, "MR 1"),), "F2", "there ; and back"),
        Macro("f12", (MacroStep(0.0, "H"),), "F12"),
        Macro("f13", (MacroStep(0.0, "PR P"),)),
    ]


def test_a_stop_is_explained_in_the_note() -> None:
    (macro,) = imported("F2 ^[ ; hold", "keys.txt")
    assert macro.note == f"hold ({REMARK})"
    assert exported([macro]) == "F2 ^[ ; hold\n"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "keys.txt: no function keys"),
        ("MR 1^M", "keys.txt:1:1: not a function key; valid: F2 STRING"),
        ("F0 MR 1^M", "keys.txt:1:1: not a function key"),
        ("\nF2 MR 1", "keys.txt:2:8: the last line has no ^M"),
        ("F2 MR 1^M^Q", "keys.txt:1:10: ^Q has no counterpart; nothing was imported"),
        ("F2 MR 1^", "keys.txt:1:8: ^ has no counterpart"),
        ("F2 ^^", "^^ has no counterpart"),
        ("F2 MR^p 1^M", "keys.txt:1:6: ^p in the middle of a line"),
        ("F2 MR 1^M^d", "^d needs a number"),
        ("F2 ^r2", "^r2 repeats nothing"),
        ("F2 H^M^r0", "^r0 repeats nothing"),
        ("F2 H^M^r9999^r9999", "makes more than 10000 lines"),
        ("F2 H^M^d99999999", "a pause of more than a day"),
        ("F2 H^M^d1234567890", "needs a number"),
        ("F2 ^M", "an empty line cannot be sent"),
        ("F2 ^[ ^M", "keys.txt:1:7: an empty line cannot be sent"),
        ("F2 /stop^M", "/ at the beginning of a line would be multidrop's own"),
        ("F2 @b MR 1^M", "@ at the beginning"),
        ("F2 a\x1bb^M", "keys.txt:1: control character (U+001B)"),
        ("F2 H^M\nF2 H^M", "keys.txt:2: F2 is defined twice"),
        ("F2 H^M^f3", "F2 calls F3, which is not there"),
        ("F2 H^M^f2", "F2 calls itself in the end"),
        ("F2 ^f3\nF3 ^f4\nF4 ^f2", "F2 calls itself in the end"),
        ("F2", "not a function key"),
        ("F2 ; nothing", "nothing to send"),
    ],
)
def test_what_has_no_counterpart_is_told_with_its_place(text: str, says: str) -> None:
    with pytest.raises(Diagnostic) as caught:
        imported(text, "keys.txt")
    assert says in str(caught.value)


@pytest.mark.parametrize(
    ("macro", "says"),
    [
        (Macro("m", (MacroStep(0, "H"),)), "macro m: it is on no function key; /key F3 m gives it one"),
        (Macro("f2", (MacroStep(0, "@b MR 1"),)), "macro f2, step 1: '@b MR 1' has no counterpart"),
        (Macro("f2", (MacroStep(0, "/wait stopped"),)), "'/wait stopped' has no counterpart"),
        (Macro("f2", (MacroStep(0, "PR ^x"),)), "has no counterpart"),
        (Macro("f2", (MacroStep(0, "A ; b"),)), "has no counterpart"),
        (Macro("f2", (MacroStep(0, "MR {n}"),)), "a value has no counterpart"),
        (Macro("f2", (MacroStep(0, "MR 1"),), roles=("a",)), "a role has no counterpart"),
        (Macro("f2", (MacroStep(0, "MR 1"),), on_early_end=("H",)), "on_early_end has no counterpart"),
        (Macro("f2", (MacroStep(0.0001, "MR 1"),)), "a pause of 0.0001 s has no counterpart"),
        (Macro("f2", (MacroStep(0.001, "1"),)), "a pause of 1 ms before a digit"),
        (Macro("f2", (MacroStep(0, "/play f3"), MacroStep(0, "5"))), "a line that begins with a digit after ^f"),
    ],
)
def test_what_cannot_be_exported_is_told(macro: Macro, says: str) -> None:
    with pytest.raises(Diagnostic) as caught:
        exported([macro])
    assert says in str(caught.value)


def test_two_macros_on_a_key_are_not_exported() -> None:
    with pytest.raises(Diagnostic, match="F2 is taken by another macro"):
        exported([Macro("f2", (MacroStep(0, "H"),)), Macro("m", (MacroStep(0, "H"),), "F2")])


@pytest.mark.parametrize(
    ("seconds", "pause"),
    [(0.05, "^m"), (1, "^p"), (5, "^p^p^p^p^p"), (5.95, "^p" * 5 + "^m" * 19), (6, "^d6000"), (0.01, "^d10")],
)
def test_a_pause_up_to_six_seconds_is_spelt_out_in_seconds_and_twentieths(seconds: float, pause: str) -> None:
    macro = Macro("f3", [MacroStep(0, "H"), MacroStep(0, f"/sleep {seconds}"), MacroStep(0, "PR P")], "F3")
    assert exported([macro]) == f"F3 H^M{pause}PR P^M\n"


def test_sleeps_become_pauses() -> None:
    macro = Macro(
        "m", (MacroStep(0, "H"), MacroStep(0, "/sleep 1.5"), MacroStep(0.5, "PR P"), MacroStep(7, "5")), "F3", "a note"
    )
    assert exported([macro]) == "F3 H^M^p^m^m^m^m^m^m^m^m^m^mPR P^M^d6950^m5^M ; a note\n"


LINES = st.text("MR {}1;a\tä=", min_size=1, max_size=8).map(str.strip).filter(bool)
PAUSES = st.lists(st.sampled_from(["^p", "^m", "^d20", "^d100000"]), max_size=2).map("".join)
PARTS = st.tuples(PAUSES, LINES).map(lambda pair: f"{pair[0]} {pair[1]}^M") | st.sampled_from(
    ["^[^M", "^C", "^f9", "^r2"]
)


@given(st.lists(PARTS, min_size=1, max_size=6), PAUSES, st.text("ab ;^", max_size=5))
def test_what_was_imported_is_exported_to_what_imports_the_same(parts: list[str], last: str, note: str) -> None:
    try:
        macros = imported(f"F2 {''.join(parts)}{last} ; {note}", "keys.txt", ["f9"])
        text = exported(macros)
    except Diagnostic:
        return
    assert imported(text, "keys.txt", ["f9"]) == macros


@given(st.text() | st.text("F2 ^MJpmdrf[C09;\n"))
def test_any_text_is_macros_or_a_diagnostic(text: str) -> None:
    try:
        assert imported(text, "keys.txt")
    except Diagnostic as problem:
        assert str(problem).startswith("keys.txt")


AFTER = st.integers(0, 200_000).map(lambda milliseconds: milliseconds / 1000)


@given(
    st.lists(st.tuples(AFTER, LINES), min_size=1, max_size=5), st.text("ab c", max_size=6).map(str.split).map(" ".join)
)
def test_an_exported_macro_is_imported_as_it_was(lines: list[tuple[float, str]], note: str) -> None:
    macro = Macro(
        "f2", tuple(MacroStep(after, line.replace("{", "{{").replace("}", "}}")) for after, line in lines), "F2", note
    )
    try:
        text = exported([macro])
    except Diagnostic:
        return
    assert imported(text, "keys.txt") == [macro]
