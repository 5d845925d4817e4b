"""Operations from functions: what is read of their parameters, and how lines and commands become calls of them."""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Annotated, Any, Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic
from multidrop.shell.operations import arguments, table
from multidrop.shell.operations.argument_types import NamedValue
from multidrop.shell.operations.operation import Operation
from multidrop.shell.operations.parameter import Argument, Listed, OneOf, Parameter, parameters
from multidrop.shell.operations.parsing import add_parameters, values
from multidrop.shell.operations.verb import Verb
from tests.support.cases import for_each

File = Annotated[str, Argument("a file", metavar="FILE", listed=(Listed.FILE,))]
Count = Annotated[int, Argument("how many", metavar="N", read=arguments.count)]
Rest = Annotated[str, Argument(metavar="TEXT ...", rest=True)]
WHERE = OneOf("where")
To = Annotated[str, Argument(one_of=WHERE)]
Colour = Annotated[str, Argument(words={"red": "like blood", "green": "like grass"})]


@dataclass(frozen=True, kw_only=True)
class Manner:
    """A set of arguments."""

    loud: bool = False
    names: tuple[File, ...] = ()


SEEN: list[tuple[Any, ...]] = []


def copy(at: object, file: File, count: Count = 1, *values: NamedValue, fast: bool = False, to: File = "") -> None:
    SEEN.append((file, count, values, fast, to))


async def tell(at: object, file: File, text: Rest) -> None:
    SEEN.append((file, text))


def paint(at: object, colour: Colour, side: Literal["left", "right"] = "left") -> None:
    SEEN.append((colour, side))


def alone(at: object) -> None:
    SEEN.append(())


def there(call: object, address: str = "") -> tuple[object, str]:
    return call, address


VERB = Verb(
    (
        Operation(copy, verb="/x", help="Copy a file.\n\nMore."),
        Operation(tell, verb="/x tell", help="say it", changes=True),
        Operation(paint, verb="/x paint", help="paint it"),
    )
)


def done(verb: Verb, line: str) -> tuple[Any, ...]:
    chosen = verb.parsed(line)
    coroutine = chosen.form.work(SimpleNamespace(session=None), chosen.values)  # type: ignore[arg-type]
    with pytest.raises(StopIteration):
        coroutine.send(None)
    return SEEN.pop()


# Lines


@for_each(
    "line, call",
    [
        ("f", ("f", 1, (), False, "")),
        ("'a b' 7", ("a b", 7, (), False, "")),
        ("f 7 A=1 B=2", ("f", 7, (("A", "1"), ("B", "2")), False, "")),
        ("--fast f --to g 7 A=1", ("f", 7, (("A", "1"),), True, "g")),
        ("tell f what  is 'typed' --fast", ("f", "what  is 'typed' --fast")),
        ("paint red", ("red", "left")),
        ("paint green right", ("green", "right")),
    ],
)
def test_a_line_is_a_call_of_its_function(line: str, call: tuple[object, ...]) -> None:
    assert done(VERB, line) == call


COPY = f"usage: {VERB.usage}"


@for_each(
    "line, words",
    [
        ("", f"/x: {COPY}"),
        ("f 0", f"/x: 0 is not a number from 1 to 100000; {COPY}"),
        ("f 1 A", f"/x: A is not NAME=VALUE; {COPY}"),
        ("f 1 A=1 A=2", f"/x: A is given twice; {COPY}"),
        ("f --fast --fast", f"/x: --fast is given twice; {COPY}"),
        ("f --to a --to b", f"/x: --to is given twice; {COPY}"),
        ("f --to", f"/x: --to needs a value; {COPY}"),
        ("f --fas", f"/x: no option --fas; {COPY}"),
        ("f 'a", "/x: a quotation mark is not closed"),
        ("tell f", "/x: usage: /x tell FILE TEXT ..."),
        ("paint blue", "/x: blue is none of red, green; usage: /x paint red|green [left|right]"),
        ("paint red left more", "/x: usage: /x paint red|green [left|right]"),
    ],
)
def test_another_line_is_refused_with_the_usage_of_what_it_means(line: str, words: str) -> None:
    with pytest.raises(Diagnostic) as caught:
        VERB.parsed(line)
    assert str(caught.value) == words and not SEEN


NAMES = st.text(st.characters(exclude_categories=("C", "Z"), exclude_characters="'\"="), min_size=1)


@given(
    file=NAMES.filter(lambda text: not text.startswith("-") and text not in ("tell", "paint")),
    count=st.integers(1, 100_000),
    pairs=st.dictionaries(NAMES.filter(lambda text: not text.startswith("-")), st.text("abc =-", max_size=9)),
    fast=st.booleans(),
    to=st.one_of(st.just(""), NAMES.filter(lambda text: not text.startswith("-"))),
    data=st.data(),
)
def test_every_value_comes_back_as_it_was_given(
    file: str, count: int, pairs: dict[str, str], fast: bool, to: str, data: st.DataObject
) -> None:
    places = [file, str(count), *(f"{name}={value}" for name, value in pairs.items())]
    options = [["--fast"]] * fast + [["--to", to]] * bool(to)
    words = [*places]
    for option in options:
        words.insert(data.draw(st.integers(0, len(words))) if option == ["--fast"] else len(words), "\0".join(option))
    line = " ".join(shlex.quote(each) for word in words for each in word.split("\0"))
    assert done(VERB, line) == (file, count, tuple(pairs.items()), fast, to)


@given(st.text(st.characters(exclude_categories=("Cs",)), max_size=40))
def test_any_text_is_a_call_or_one_line_of_error(text: str) -> None:
    try:
        VERB.parsed(text)
    except Diagnostic as problem:
        assert len(str(problem).splitlines()) == 1 or not text.isprintable()


def test_what_a_verb_is_given_may_take_arguments_of_its_own() -> None:
    def seen(at: tuple[object, str], file: str) -> None:
        SEEN.append((file, at[1]))

    verb = Verb((Operation(seen, verb="/y", at=there, help="See."),))
    assert verb.usage == "/y FILE [ADDRESS]"
    assert done(verb, "f") == ("f", "") and done(verb, "f b") == ("f", "b")


def test_a_form_without_arguments_puts_the_others_into_brackets() -> None:
    verb = Verb((Operation(alone, verb="/z", help="Alone."), Operation(paint, verb="/z paint")))
    assert verb.usage == "/z [paint red|green [left|right]]"
    assert done(verb, "") == () and done(verb, "paint red") == ("red", "left")


def test_a_form_says_whether_it_changes_a_drive() -> None:
    assert VERB.parsed("tell f x").form.changes and not VERB.parsed("f").form.changes


# What is typed


def offered(typed: str) -> list[str]:
    return [each.value if isinstance(each, Parameter) else each[0] for each in VERB.following(typed.split())]


@for_each(
    "typed, words",
    [
        ("", ["FILE", "tell", "paint"]),
        ("f", ["N", "NAME=VALUE", "--fast", "--to"]),
        ("f 1", ["NAME=VALUE", "--fast", "--to"]),
        ("f --fast", ["N", "NAME=VALUE", "--to"]),
        ("f --to", ["FILE"]),
        ("f --to g", ["N", "NAME=VALUE", "--fast"]),
        ("tell", ["FILE"]),
        ("tell f", ["TEXT ..."]),
        ("paint", ["red", "green", "COLOUR"]),
        ("paint red", ["left", "right", "left|right"]),
        ("paint blue", []),
        ("f --other", []),
    ],
)
def test_what_may_follow_is_offered_once(typed: str, words: list[str]) -> None:
    expected = [each if each != "COLOUR" else "red|green" for each in words]
    assert offered(typed) == expected


@for_each(
    "typed, usage",
    [
        ("", VERB.usage),
        ("te", VERB.usage_of(VERB.forms[:2])),
        ("tell", "/x tell FILE TEXT ..."),
        ("tell f", "/x tell FILE TEXT ..."),
        ("f --t", "/x FILE [N] [NAME=VALUE ...] [--fast] [--to FILE]"),
        ("paint purple", VERB.usage),
    ],
)
def test_the_usage_is_narrowed_to_what_is_typed(typed: str, usage: str) -> None:
    assert VERB.narrowed(typed.split()) == usage


def test_fixed_words_and_options_have_meanings() -> None:
    assert VERB.words["tell"] == "say it" and VERB.words["red"] == "like blood"
    assert VERB.meaning_of(["paint"]) == "paint it" and VERB.meaning_of(["f"]) == "Copy a file."
    assert VERB.described() == [VERB.usage, "Copy a file.", "", "More."]


# Commands


def command(function: Callable[..., Any], *given: str, through: Callable[..., Any] | None = None) -> int:
    operation = Operation(function, command="x", meaning="x", through=through)
    parser = argparse.ArgumentParser(exit_on_error=False)
    operation.add_to(parser)
    return operation.command_work(parser.parse_args(given))


def test_a_command_is_a_call_of_its_function() -> None:
    def run(url: str, lines: tuple[str, ...], *, manner: Manner, count: Count = 2) -> int:
        SEEN.append((url, lines, manner, count))
        return 3

    assert command(run, "u", "a", "b", "--loud", "--names", "x", "--names", "y", "--count", "5") == 3
    assert SEEN.pop() == ("u", ("a", "b"), Manner(loud=True, names=("x", "y")), 5)
    assert command(run, "u", "a") == 3 and SEEN.pop() == ("u", ("a",), Manner(), 2)
    with pytest.raises(argparse.ArgumentError, match="--count: 0 is not a number"):
        command(run, "u", "a", "--count", "0")


def test_a_command_may_be_given_what_another_function_opens() -> None:
    def opened(work: Callable[[str], object], url: str, *, loud: bool = False) -> int:
        work(f"{url}!" if loud else url)
        return 4

    async def opening(work: Callable[[str], object], url: str) -> int:
        work(url)
        return 5

    assert command(copy, "u", "f", "3", "--loud", "--fast", through=opened) == 4
    assert SEEN.pop() == ("f", 3, (), True, "")
    assert command(copy, "u", "f", through=opening) == 5 and SEEN.pop()


def test_arguments_that_exclude_each_other_are_not_taken_together() -> None:
    def run(*, to: To = "", serve: To = "") -> None:
        SEEN.append((to, serve))

    assert command(run, "--to", "x") == 0 and SEEN.pop() == ("x", "")
    with pytest.raises(argparse.ArgumentError, match="not allowed with"):
        command(run, "--to", "x", "--serve", "y")


# Declarations


def test_a_parameter_that_says_no_type_is_a_clear_error() -> None:
    def run(url):  # type: ignore[no-untyped-def]
        pass

    def further(url: NoSuchType) -> None:  # type: ignore[name-defined]  # noqa: F821
        pass

    def anything(**more: str) -> None:
        pass

    for function, words in (
        (run, "url of .* has no annotation"),
        (further, "the type of url of .* cannot be read: name 'NoSuchType' is not defined"),
        (anything, r"has \*\*more, which no line can give"),
    ):
        with pytest.raises(Diagnostic, match=words):
            parameters(function)


@pytest.mark.parametrize("operation", table.core(), ids=lambda each: each.verb or each.command)
def test_every_operation_is_declared_well(operation: Operation) -> None:
    """Its annotations are read, its names differ, and what is said in one line is one."""
    for arguments_of in (operation.arguments, operation.command_arguments):
        assert len({each.name for each in arguments_of}) == len(arguments_of)
        optional = [not each.required for each in arguments_of if not each.option]
        add_parameters(argparse.ArgumentParser(), arguments_of)
        assert all(isinstance(each.help, str) for each in arguments_of) and optional is not None
    assert "\n" not in operation.meaning
    assert not operation.command or operation.meaning
    assert not operation.verb or operation.do is None or VERBS_OF[operation.name].help


VERBS_OF = {**table.VERBS, **table.script_verbs()}


def test_a_value_that_is_not_given_is_the_default() -> None:
    found = parameters(copy, 1)
    parser = argparse.ArgumentParser()
    add_parameters(parser, found)
    assert values(found, parser.parse_args(["f"])) == {"file": "f", "count": 1, "values": (), "fast": False, "to": ""}


FORMS_ALONE = Verb((Operation(verb="/y", help="Be."), Operation(alone, verb="/y on", help="go"), *VERB.forms[1:2]))


@for_each("line", ["", "off", "o", "on f"])
def test_a_line_without_the_fixed_words_of_a_form_is_not_that_form(line: str) -> None:
    with pytest.raises(Diagnostic, match="usage: /y "):
        FORMS_ALONE.parsed(line)
    assert FORMS_ALONE.parsed("on").form.verb == "/y on"


def test_an_option_that_another_form_has_is_not_called_unknown() -> None:
    def crawl(at: object, *, slow: bool = False) -> None:
        """Never called."""

    verb = Verb((Operation(copy, verb="/z", help="Copy."), Operation(crawl, verb="/z")))
    with pytest.raises(Diagnostic, match="^/z: usage: /z FILE"):
        verb.parsed("--fast")
    with pytest.raises(Diagnostic, match="^/z: no option --other; usage: /z FILE"):
        verb.parsed("--other")


def test_every_verb_of_the_core_is_in_the_group_that_it_names_also_where_a_feature_adds_forms():
    listed = {name: title for title, names in table.groups().items() for name in names}
    assert listed["/plot"] == "Settings and values"
    assert all(listed[name] == verb.group != "" for name, verb in table.VERBS.of_core.items())
