"""Help, completion and hints of MCode words."""

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.families.lexium.manual import help as mcode_help
from multidrop.families.lexium.manual.help import LANGUAGE
from multidrop.families.lexium.manual.table import MNEMONICS
from tests.support.cases import for_each


def test_help_on_a_variable_tells_all_about_it() -> None:
    assert LANGUAGE.describe("vm") == [
        "VM: Maximum velocity (variable)",
        "  velocity that moves go up to",
        "  syntax     VM=<velocity>, PR VM",
        "  range      2 to 2560000 steps/s (EE=0), 2 to 200000 counts/s (EE=1)",
        "  default    768000 (EE=0), 60000 (EE=1)",
        "  access     read and write",
        "  use        immediate and in programs",
        "  products   all",
        "  note       more than VI, at most MS*10000; acts from the next move on",
        "  manual     MCode reference 5.1.140",
    ]


@pytest.mark.parametrize(
    ("word", "line"),
    [
        ("CL", "  use        in programs only"),
        ("EX", "  use        immediate only"),
        ("AS", "  products   LMDCE, LMDCM"),
        ("S1", "  products   MDrivePlus"),
        ("F3", "  products   Lexium MDrive and Motion Module"),
        ("MS", "  range      1, 2, 4, 5, 8, 10, 16, 25, 32, 50, 64, 100, 108, 125, 127, 128, 180, 200, 250, 256 "
               "steps/full step"),
        ("HC", "  range      0 to 100 %"),
        ("ER", "  access     read, and cleared"),
    ],
)  # fmt: skip
def test_help_says(word: str, line: str) -> None:
    assert line in LANGUAGE.describe(word)


@for_each("word", MNEMONICS)
def test_there_is_help_on_every_word(word: str) -> None:
    lines = LANGUAGE.describe(word)
    assert lines[0].startswith(f"{word}: ") and len(lines) >= 3
    assert all(line == line.rstrip() and "None" not in line for line in lines)


@pytest.mark.parametrize(
    ("word", "meant"), [("MRR", "MR"), ("velocity", "VM"), ("F9", "F1"), ("Baud", "BD"), ("home", "HM")]
)
def test_an_unknown_word_is_answered_with_what_was_perhaps_meant(word: str, meant: str) -> None:
    with pytest.raises(Diagnostic) as caught:
        LANGUAGE.describe(word)
    assert word in caught.value.message and meant in caught.value.hint.replace(",", "").split()


def test_an_unknown_word_that_looks_like_nothing_has_no_suggestion() -> None:
    with pytest.raises(Diagnostic) as caught:
        LANGUAGE.describe("##")
    assert caught.value.hint == ""


def test_completion_offers_words_with_their_meaning_in_order() -> None:
    offered = LANGUAGE.complete("m")
    assert [word for word, _ in offered] == ["MA", "MD", "MF", "MP", "MR", "MS", "MT", "MU", "MV"]
    assert dict(offered)["MA"] == MNEMONICS["MA"].meaning
    assert [word for word, _ in LANGUAGE.complete("o1")] == ["O1"]
    assert LANGUAGE.complete("zz") == []


def test_completion_offers_neither_operators_nor_reserved_words() -> None:
    words = [word for word, _ in LANGUAGE.complete("")]
    assert "SQ" in words and "D4" in words
    assert not {"FT", "PK", "I7", "+", "<="} & set(words)


@pytest.mark.parametrize(
    ("typed", "about"),
    [
        ("MR 512", "MR"), ("mr512", "MR"), ("SL-400", "SL"), ("D5=3", "D5"), ("R1=R2+VM", "R1"), ("PR", "PR"),
        (" VM = ", "VM"), ("F1=C_ F2", "F1"), ("H 100", "H"),
    ],
)  # fmt: skip
def test_a_hint_tells_syntax_and_meaning_of_the_leading_word(typed: str, about: str) -> None:
    row = MNEMONICS[about]
    assert LANGUAGE.hint(typed) == f"{row.syntax}   {row.meaning}; manual {row.section}"


@pytest.mark.parametrize(
    ("typed", "about"), [("PR P", "P"), ('PR "VM is",vm', "VM"), ("pr MV ST", "ST"), ("PR=AL", "AL"), ("PR Q7,P", "P")]
)
def test_a_hint_of_a_print_is_about_what_is_printed(typed: str, about: str) -> None:
    row = MNEMONICS[about]
    assert LANGUAGE.hint(typed) == f"PR {about}   {row.meaning}; manual {row.section}"


@pytest.mark.parametrize("typed", ["", "   ", "512", "Q1=3", "@", '"MR"', "I9"])
def test_there_is_no_hint_where_nothing_is_known(typed: str) -> None:
    assert LANGUAGE.hint(typed) == ""


def test_text_in_quotation_marks_is_not_taken_for_words() -> None:
    assert LANGUAGE.hint('PR "VM P') == LANGUAGE.hint("PR")


@pytest.mark.parametrize(
    ("code", "product", "lines"),
    [
        (35, "LMDCM", ["error 35: this cannot be printed"]),
        (
            22,
            "",
            ["error 22: VI must be below VM", "  do         lower VI or raise VM first"],
        ),
        (14, "LMM", ["error 14: the enable input holds the module disabled"]),
    ],
)
def test_help_on_an_error_number_is_that_of_the_product(code: int, product: str, lines: list[str]) -> None:
    assert LANGUAGE.describe_error(code, product) == lines


def test_without_a_product_each_family_is_told_that_has_the_number() -> None:
    (only,) = LANGUAGE.describe_error(14)
    assert only.startswith("error 14 (") and "LMM" in only and "LMD" not in only


@pytest.mark.parametrize(("code", "product"), [(500, ""), (14, "LMDCM"), (104, "LMM"), (5, "LMDCM")])
def test_a_number_that_a_product_does_not_have_is_told(code: int, product: str) -> None:
    with pytest.raises(Diagnostic, match=f"no error {code}"):
        LANGUAGE.describe_error(code, product)


@pytest.mark.parametrize(
    ("word", "parts"),
    [
        ("PR", (r"\b", r"\c", r"\e", r"\g", r"\n", r"\r", r"\t", "asks before")),
        ("AO", ("1 error", "4 lead", "8 lag", "512", "16384", "32768", "2 locked", "256 no +V", "8192")),
        ("IS", ("4 go", "11 reset", "12 capture", "13 step", "14 encoder", "15 up", "9 voltage", "10 current", "IS=6")),
        ("OS", ("16 user", "21 locked", "25 make-up", "27 encoder", "28 trip (output 3", "29 attention", "NEMA 17")),
        ("TR", ("OS=3,28,0", "RT", "error 39", "20000")),
        ("TP", ("RT", "error 43", "error 39")),
        ("SF", ("EE=1", "SM=0", "86")),
        ("CK", ("0x90", "0xC9", "two's complement", "ACK", "NAK")),
    ],
)
def test_help_says_what_the_numbers_and_codes_of_a_word_mean(word: str, parts: tuple[str, ...]) -> None:
    told = "\n".join(LANGUAGE.describe(word, "LMDCM"))
    assert [part for part in parts if part not in told] == []


@for_each("word", sorted(mcode_help.details()))
def test_further_lines_are_of_a_lexiums_words_and_begin_with_a_label(word: str) -> None:
    assert word in MNEMONICS and mcode_help.details()[word][0]["label"]
    assert all(each["text"] and set(each) == {"word", "label", "text"} for each in mcode_help.details()[word])
    if (own := mcode_help.MDRIVE.get(word)) is not None and own.products:
        texts = " ".join(each["text"] for each in mcode_help.details()[word])
        assert texts.split(";")[0] not in "\n".join(LANGUAGE.describe(word, "MDIX"))


@pytest.mark.parametrize("topic", ["homing", "trip", "Trips", "PARTY", "checksum"])
def test_a_topic_says_what_several_words_do_together(topic: str) -> None:
    first, *lines = LANGUAGE.describe(topic)
    assert first == f"{topic.lower().removesuffix('s')} (topic)" and len(lines) >= 4 and LANGUAGE.knows(topic)
    more = lines[-1].split("help ")[1].split(" says")[0].split(", ")
    assert all(word in MNEMONICS for word in more)


def test_an_error_with_a_meaning_of_its_own_in_a_family_has_its_own_remedy() -> None:
    assert LANGUAGE.describe_error(94) == [
        "error 94 (LMD, LMM): the drive is disabled",
        "  do         DE=1 enables it; with hMT, CF after a locked rotor (104)",
        "error 94 (MDI): CF not while moving",
        "  do         stop first (SL 0), then try again",
    ]
    assert LANGUAGE.describe_error(94, "MDIE") == [
        "error 94: CF not while moving",
        "  do         stop first (SL 0), then try again",
    ]
