"""The values that an option takes: the first and the last valid one, what is said of any other, and options twice."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Any

import pytest

from multidrop.shell.operations import arguments
from multidrop.shell.operations.arguments import Each, Once, Several
from tests.support.cases import for_each

VALID = [
    (arguments.baud, "300", 300),
    (arguments.baud, "1000000", 1_000_000),
    (arguments.any_baud, "1", 1),
    (arguments.any_baud, "99999999", 99_999_999),
    (arguments.count, "1", 1),
    (arguments.count, "100000", 100_000),
    (arguments.rounds, "1", 1),
    (arguments.rounds, "1000000000", 10**9),
    (arguments.rounds, "forever", None),
    (arguments.duration, "0.001", 0.001),
    (arguments.duration, "1e7", 1e7),
    (arguments.speed, "0.001", 0.001),
    (arguments.speed, "1000", 1000.0),
    (arguments.named_value, "A=1", ("A", "1")),
    (arguments.named_value, "A=", ("A", "")),
    (arguments.named_value, "A=b=c", ("A", "b=c")),
    (arguments.role_url, "left-arm_2=sim:cell", ("left-arm_2", "sim:cell")),
    (arguments.role_url, "_x=y", ("_x", "y")),
    (arguments.key_and_values, " VM =1,2", ("VM", "1,2")),
    (arguments.key_and_values, "VM=", ("VM", "")),
    (arguments.allowed, ".", "."),
    (arguments.function_key, "f2", "F2"),
    (arguments.function_key, "F12", "F12"),
    (arguments.address, "80", ("127.0.0.1", 80)),
    (arguments.address, ":0", ("127.0.0.1", 0)),
    (arguments.address, "cell:65535", ("cell", 65535)),
    (arguments.address, "[::1]:80", ("::1", 80)),
]


@for_each("take, text, value", VALID)
def test_a_valid_value_is_taken(take: Callable[[str], Any], text: str, value: object) -> None:
    assert take(text) == value


NAME = "is not a name of letters, digits, - and _, not - first"
WRONG = [
    (arguments.baud, "299", "299 is not a number from 300 to 1000000"),
    (arguments.baud, "1000001", "1000001 is not a number from 300 to 1000000"),
    (arguments.any_baud, "0", "0 is not a number from 1 to 99999999"),
    (arguments.any_baud, "100000000", "100000000 is not a number from 1 to 99999999"),
    (arguments.count, "0", "0 is not a number from 1 to 100000"),
    (arguments.count, "100001", "100001 is not a number from 1 to 100000"),
    (arguments.rounds, "0", "0 is not a number from 1 to 1000000000, or forever"),
    (arguments.rounds, "1000000001", "1000000001 is not a number from 1 to 1000000000, or forever"),
    (arguments.duration, "0", "0 is not a number of seconds above 0"),
    (arguments.duration, "10000001", "10000001 is not a number of seconds above 0"),
    (arguments.duration, "soon", "soon is not a number of seconds above 0"),
    (arguments.speed, "0.0009", "0.0009 is not a number from 0.001 to 1000"),
    (arguments.speed, "1000.1", "1000.1 is not a number from 0.001 to 1000"),
    (arguments.speed, "fast", "fast is not a number from 0.001 to 1000"),
    (arguments.named_value, "A", "A is not NAME=VALUE"),
    (arguments.named_value, "=1", "=1 is not NAME=VALUE"),
    (arguments.role_url, "=x", "=x is not NAME=VALUE"),
    (arguments.role_url, "-a=x", f"-a {NAME}"),
    (arguments.role_url, "a b=x", f"a b {NAME}"),
    (arguments.role_url, "\u00e4=x", f"\u00e4 {NAME}"),
    (arguments.role_url, "--=x", f"-- {NAME}"),
    (arguments.key_and_values, "VM", "VM is not KEY=VALUES"),
    (arguments.key_and_values, " =1", " =1 is not KEY=VALUES"),
    (arguments.allowed, "", "an empty path would allow the current folder; name the path"),
    (arguments.function_key, "F1", "no key F1; valid: F2 to F12"),
    (arguments.function_key, "F13", "no key F13; valid: F2 to F12"),
    (arguments.address, "cell:65536", "no port 'cell:65536'; valid: PORT or HOST:PORT"),
    (arguments.address, "cell", "no port 'cell'; valid: PORT or HOST:PORT"),
    (arguments.address, "", "no port ''; valid: PORT or HOST:PORT"),
]


@for_each("take, text, words", WRONG)
def test_another_value_is_named_with_what_is_valid(take: Callable[[str], Any], text: str, words: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError) as caught:
        take(text)
    assert str(caught.value) == words


def parsed(action: type[argparse.Action], kind: Callable[[str], Any], *given: str) -> object:
    parser = argparse.ArgumentParser(exit_on_error=False)
    parser.add_argument("--x", action=action, type=kind)
    parser.add_argument("--y", action=action, type=kind)
    return parser.parse_args(given).x


@for_each(
    "action, kind, given, value",
    [
        (Several, str, ("--x", "a"), "a"),
        (Several, str, ("--x", "a", "--x", "b"), "a,b"),
        (Once, str, ("--x", "a", "--y", "b"), "a"),
        (Each, str, ("--x", "a", "--x", "a"), ["a", "a"]),
        (Each, arguments.named_value, ("--x", "A=1", "--x", "B=1", "--y", "A=2"), [("A", "1"), ("B", "1")]),
    ],
)
def test_an_option_that_is_repeated_has_all_its_values(
    action: type[argparse.Action], kind: Callable[[str], Any], given: tuple[str, ...], value: object
) -> None:
    assert parsed(action, kind, *given) == value


@for_each(
    "action, kind, given, words",
    [
        (Once, str, ("--x", "a", "--x", "a"), "argument --x: given twice"),
        (Each, arguments.named_value, ("--x", "A=1", "--x", "B=2", "--x", "A=3"), "argument --x: A is given twice"),
    ],
)
def test_what_can_be_given_once_is_refused_the_second_time(
    action: type[argparse.Action], kind: Callable[[str], Any], given: tuple[str, ...], words: str
) -> None:
    with pytest.raises(argparse.ArgumentError) as caught:
        parsed(action, kind, *given)
    assert str(caught.value) == words
