"""The verbs that only scripts have: conditions, loops, values, checks, calls."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Annotated

from multidrop.shell.operations import arguments
from multidrop.shell.operations.argument_types import NamedValue
from multidrop.shell.operations.operation import Operation, Scripted, VerbKind
from multidrop.shell.operations.parameter import Argument, Listed
from multidrop.shell.verbs.waiting import Seconds

if TYPE_CHECKING:
    from multidrop.shell.scripts.use import LineCheck, LineUse

MOST_SHOWN_PRINTS = 3
"""The number of printed lines that a failed `/expect` shows."""
LISTENS = 1.0
"""The default time in which `/expect` looks for its text, s."""
Expression = Annotated[str, Argument(metavar="EXPR", rest=True)]
Count = Annotated[str, Argument(metavar="N", rest=True)]
Check = Annotated[str, Argument(metavar="[@ADDR] EXPR OP EXPR [+- N]", rest=True)]
Name = Annotated[str, Argument(metavar="NAME")]
Wanted = Annotated[str, Argument(metavar='"TEXT"', read=arguments.some_text)]
Text = Annotated[str, Argument(metavar="TEXT", rest=True)]
Called = Annotated[str, Argument(metavar="FILE|MACRO", listed=(Listed.FILE, Listed.MACRO))]


def check_expression(checking: LineCheck, expression: Expression) -> None:
    checking.expression(expression)


def check_comparison(checking: LineCheck, check: Check) -> None:
    checking.comparison(check)


# Values


async def set_(use: LineUse, name: Name, expression: Expression) -> None:
    from multidrop.shell.scripts.expression import written

    use.names[name] = written(await use.value(expression))


def check_set(checking: LineCheck, name: Name, expression: Expression) -> None:
    from multidrop.shell.scripts.words import check_name

    check_name(name)
    checking.expression(expression)
    checking.names[name] = None


def print_(use: LineUse, text: Text = "") -> None:
    use.session.output(text, origin=use.origin)


# Blocks


async def holds(use: LineUse, expression: Expression) -> bool:
    from multidrop.shell.scripts.expression import number

    return bool(number(await use.value(expression)))


async def holds_not(use: LineUse, expression: Expression) -> bool:
    return not await holds(use, expression)


async def rounds(use: LineUse, expression: Count) -> int:
    from multidrop.shell.scripts.words import repetitions

    return repetitions(await use.value(expression))


def check_rounds(checking: LineCheck, expression: Count) -> None:
    """Also the number, where that is known beforehand."""
    from multidrop.shell.scripts.expression import evaluate, unknowns
    from multidrop.shell.scripts.words import repetitions

    tree = checking.expression(expression)
    if checking.known and not list(unknowns(tree)):
        repetitions(evaluate(tree, {}))


def between(use: LineUse) -> None:
    """Divide or end a block."""


def call(use: LineUse, target: Called, *values: NamedValue) -> None:
    """Stand for the lines of a file or a macro, which were read when the script was checked."""


# Checks


async def assert_(use: LineUse, check: Check) -> None:
    from multidrop.shell.scripts.checks import compare

    await compare(use, check)


async def expect(use: LineUse, text: Wanted, seconds: Seconds = LISTENS) -> None:
    from multidrop.shell import waits
    from multidrop.shell.scripts.expression import quoted
    from multidrop.shell.scripts.use import CheckFailed

    heard = use.heard
    if not await waits.listened(use.session, use.origin, partial(heard.finds, text), seconds):
        seen = ", ".join(map(quoted, heard.last(MOST_SHOWN_PRINTS))) or "nothing"
        raise CheckFailed(f'{use.text}: wanted "{text}" within {seconds:g} s, seen {seen}')


CONDITION = partial(Scripted, check=check_expression, bare=True, steers=True)
OPERATIONS = (
    Operation(
        set_,
        verb="/set",
        script=Scripted(check=check_set, bare=True, steers=True),
        help="gives a name a value, which is worked out once: a number, a text, a drive's word",
    ),
    Operation(
        holds,
        verb="/if",
        script=CONDITION(VerbKind.IF),
        help="executes the lines up to /else or /end if the expression holds",
    ),
    Operation(
        between,
        verb="/else",
        script=Scripted(VerbKind.BETWEEN),
        help="begins the lines that are executed if the expression of /if does not hold",
    ),
    Operation(
        between,
        verb="/end",
        script=Scripted(VerbKind.BETWEEN),
        help="ends a block of /if, /repeat, /while or /until",
    ),
    Operation(
        rounds,
        verb="/repeat",
        script=Scripted(VerbKind.COUNT, check_rounds, bare=True, steers=True),
        help="executes the lines up to /end N times",
    ),
    Operation(
        holds,
        verb="/while",
        script=CONDITION(VerbKind.WHILE),
        help="executes the lines up to /end while the expression holds; it is asked before each round",
    ),
    Operation(
        holds_not,
        verb="/until",
        script=CONDITION(VerbKind.WHILE),
        help="executes the lines up to /end until the expression holds; it is asked before each round",
    ),
    Operation(
        expect,
        verb="/expect",
        script=Scripted(verdict=True),
        help="looks for a text in what the last command printed, and in what comes until then (1 s); fails without it",
    ),
    Operation(
        assert_,
        verb="/assert",
        script=Scripted(check=check_comparison, bare=True, verdict=True),
        help="compares two values now, and ends the script where that does not hold; OP is ==, !=, <, <=, > or >=",
    ),
    Operation(
        assert_,
        verb="/verify",
        script=Scripted(check=check_comparison, bare=True, verdict=True, goes_on=True),
        help=(
            "compares as /assert does, but goes on where that does not hold; the end of the script is then exit code 1"
        ),
    ),
    Operation(
        print_,
        verb="/print",
        script=Scripted(),
        help="prints a text to standard output; {NAME} is replaced by its value",
    ),
    Operation(
        call,
        verb="/call",
        script=Scripted(VerbKind.CALL),
        help="executes another script, or plays a macro, with these values",
    ),
)
