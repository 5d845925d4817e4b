"""The rows around the editor of a program: file and target above it, problems and what was said below it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from multidrop.dialects.program_files import Entry, Problem, errors
from multidrop.tui.editor.texts import OpenText
from multidrop.tui.editor.widget import Mark
from multidrop.tui.panels.glance import Glance, name_of
from multidrop.tui.screen_model import Record
from multidrop.tui.text import fit, visible
from multidrop.tui.widgets.gutter import MARKS
from multidrop.tui.widgets.lines import Row, Span, spread, width_of

MOST_PROBLEMS = 4
"""Problems that are shown below the editor."""


@dataclass(frozen=True)
class Findings:
    """The findings of the last check of a text."""

    problems: tuple[Problem, ...] = ()
    addresses: tuple[tuple[int, int], ...] = ()
    """The address of a line in the drive, and the line of the text from 0; empty unless both hold one program."""
    entries: tuple[Entry, ...] = ()
    """The places at which a program can begin."""
    pending: bool = False
    """The text was edited since."""

    @property
    def words(self) -> Span:
        """The result in a few words."""
        wrong = len(errors(self.problems))
        warned = len(self.problems) - wrong
        if self.pending:
            return "checking … ", "dim"
        if wrong:
            return f"✗ {wrong} {'errors' if wrong > 1 else 'error'} ", "error"
        if warned:
            return f"! {warned} {'warnings' if warned > 1 else 'warning'} ", "strong"
        return "✓ no error ", "text"


def heading_row(text: OpenText | None, title: str, findings: Findings, target: Glance | None, width: int) -> Row:
    """The file, whether it is saved, the result of the check, and the drive that it is for."""
    if text is None:
        return ((" PROGRAM   ", "strong"), ("no file: ^E opens one", "dim"))
    state = "new, not saved" if text.file.new else "changed, not saved" if text.changed else "saved"
    where = f"for {name_of(target)} ({target.product}) " if target is not None else "no drive selected "
    left: list[Span] = [
        (" PROGRAM  ", "strong"),
        (f" {visible(text.name)} ", "accent"),
        (f" {title} ", "dim"),
        (f" {'● ' if text.changed or text.file.new else ''}{state} ", "motion" if text.changed else "dim"),
        (" ", "text"),
    ]
    if text.text.strip():
        left.append(findings.words)
    return spread(left, [(where, "dim")], width)


def problem_rows(problems: Sequence[Problem], at: int, width: int) -> list[Row]:
    """The problems from the line of the cursor on (from 1), then from the top; errors before warnings."""
    ahead = sorted(problems, key=lambda each: (each.warning, each.line < at))
    rows: list[Row] = []
    for each in ahead[:MOST_PROBLEMS]:
        hint = f"; {each.hint}" if each.hint else ""
        sign, role = ("!", "strong") if each.warning else ("✗", "error")
        place = f"{each.line}:{each.column}"
        rows.append(
            ((f" {sign} ", role), (f"{place:<7} ", "dim"), (fit(visible(each.what + hint), width - 12), "text"))
        )
    if len(problems) > MOST_PROBLEMS:
        rows[-1] = (
            (fit(f"   … and {len(problems) - MOST_PROBLEMS + 1} more; ^L goes from one to the next", width), "dim"),
        )
    return rows


def news_rows(records: Sequence[Record], clock: Callable[[float], str], width: int) -> list[Row]:
    """The last lines of the transcript, a row each."""
    rows: list[Row] = []
    for each in records:
        sign, role = MARKS[each.mark]
        head = f" {clock(each.at)} "
        rows.append(
            (
                (head, "dim"),
                (f"{fit(each.address, 3)} ", "dim"),
                (f"{sign} ", role),
                (fit(visible(each.text), width - len(head) - 6), "error" if each.mark == "x" else "text"),
            )
        )
    return rows


def rule(title: str, width: int, right: str = "") -> Row:
    """A rule with a title in it, and what goes on at its right end."""
    left: list[Span] = [("─", "rule"), (f" {title} ", "strong")]
    end: list[Span] = [(f" {right} ", "motion"), ("─", "rule")] if right else []
    return (*left, ("─" * max(0, width - width_of(left) - width_of(end)), "rule"), *end)


def marks_of(problems: Sequence[Problem], break_line: int | None, current: tuple[int, str] | None) -> dict[int, Mark]:
    """The signs of lines, from 0: the current line precedes errors, a break point and warnings."""
    marks: dict[int, Mark] = {}
    for each in problems:
        if each.line - 1 not in marks or not each.warning:
            marks[each.line - 1] = Mark("!", "warning") if each.warning else Mark("✗", "error")
    if break_line is not None and marks.get(break_line, Mark("!", "warning")).role == "warning":
        marks[break_line] = Mark("●", "break")
    if current is not None:
        marks[current[0]] = Mark(current[1], "starts")
    return marks
