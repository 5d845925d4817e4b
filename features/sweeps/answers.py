"""The answer of a sweep: the share that passed and the margin by value, a map of two keys, the boundary in words."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from html import escape
from itertools import groupby

from multidrop.base.text import visible
from multidrop.features.sweeps.plan import SweepPlan
from multidrop.features.sweeps.trial import MARGIN, TrialResult, bench
from multidrop.features.sweeps.variation import SEED, spelled

MOST_VALUES, MOST_STRETCHES = 200, 20
"""The largest number of lines for a key; beyond it, the number of stretches of neighbouring values."""
MOST_GRID_ROWS, COLUMNS, WIDTH = 40, 16, 78
"""The largest size of a map in a terminal."""
SCATTERED = 10
"""The largest number of values that are named, where failing and passing ones alternate."""
_NUMBER = re.compile(r"[+-]?[\d.]+(?: \w+)?", re.ASCII)


@dataclass
class CaseTally:
    """Cases that have something in common."""

    cases: int = 0
    passed: int = 0
    margins: dict[str, float] = field(default_factory=dict)
    """The smallest margin of each condition that has one."""

    def take(self, ok: bool, margins: Iterable[tuple[str, float]]) -> None:
        self.cases += 1
        self.passed += ok
        for name, margin in margins:
            self.margins[name] = min(margin, self.margins.get(name, margin))

    @property
    def percent(self) -> int:
        """The share that passed; 0 and 100 are exact."""
        if self.passed in (0, self.cases):
            return 100 * (self.passed > 0)
        return min(99, max(1, round(100 * self.passed / self.cases)))


@dataclass(frozen=True)
class SweptKey:
    """The values of a key that ran, or stretches of them. `at`: the label of each value, by its text."""

    name: str
    at: Mapping[str, str]

    @property
    def labels(self) -> list[str]:
        return list(dict.fromkeys(self.at.values()))

    def merged(self, most: int, stretches: int) -> SweptKey:
        """The same with stretches in place of more than `most` values."""
        texts = list(self.at)
        if len(self.labels) <= most:
            return self
        size = -(-len(texts) // stretches)
        parts = (texts[begin : begin + size] for begin in range(0, len(texts), size))
        return SweptKey(self.name, {text: _stretch(part) for part in parts for text in part})


def _stretch(texts: Sequence[str]) -> str:
    return texts[0] if len(texts) == 1 else f"{texts[0]}..{texts[-1]}"


def _number(text: str) -> Decimal | None:
    return Decimal(text.partition(" ")[0]) if _NUMBER.fullmatch(text) else None


def _sorted(texts: Iterable[str]) -> list[str]:
    """Texts by their numbers, where all have one; else as they are."""
    numbers = {text: _number(text) for text in texts}
    return (
        sorted(numbers, key=lambda each: numbers[each] or Decimal()) if None not in numbers.values() else list(numbers)
    )


class SweepAnswer:
    """The results of a sweep by value. `search`: the key whose boundary was searched; empty: a grid, or draws."""

    def __init__(self, plan: SweepPlan, results: Mapping[int, TrialResult], search: str = "") -> None:
        self._names = [visible(key.text) for key in plan.job.keys]
        self._search = search
        expects = plan.job.expects
        columns = [column.removeprefix(MARGIN) for column in bench(plan.job).columns if column.startswith(MARGIN)]
        self._cases = [
            (
                tuple(visible(spelled(value)) for value in plan.values_of(number)),
                result.ok,
                [
                    (name, float(cell))
                    for name, cell in zip(columns, result.cells, strict=False)
                    if cell and (result.ok or result.failed >= expects.index(name))  # what failed before decided it
                ],
            )
            for number, result in sorted(results.items())
        ]
        self._axes = [SweptKey(name, self._texts(at, plan)) for at, name in enumerate(self._names)]
        # The two keys that matter most, as they are written: those whose values differ most in what passes.
        spread = {}
        for index, axis in enumerate(self._axes):
            shares = [tally.passed / tally.cases for tally in self._tallies(index, axis).values()]
            if len(axis.at) > 1 and plan.job.keys[index].part != SEED:
                spread[index] = max(shares) - min(shares)
        self._pair = sorted(sorted(spread, key=lambda index: -spread[index])[:2])

    def _texts(self, index: int, plan: SweepPlan) -> dict[str, str]:
        texts: Iterable[str] = dict.fromkeys(texts[index] for texts, *_ in self._cases)
        if plan.asked.draws is not None or self._search:
            texts = _sorted(texts)
        return {text: text for text in texts}

    def _tallies(self, index: int, axis: SweptKey) -> dict[str, CaseTally]:
        tallies: dict[str, CaseTally] = {}
        for texts, ok, margins in self._cases:
            tallies.setdefault(axis.at[texts[index]], CaseTally()).take(ok, margins)
        return tallies

    def rows(self) -> Iterator[str]:
        """A line for each value of each key: the share that passed, and the smallest margin."""
        lines = []
        for index, each in enumerate(self._axes):
            axis = each.merged(MOST_VALUES, MOST_STRETCHES)
            tallies = self._tallies(index, axis)
            lines += [(f"{axis.name}={label}", tallies[label]) for label in axis.labels]
        width = max((len(name) for name, _ in lines), default=0)
        for name, tally in lines:
            margins = "; ".join(
                f"{least:{'.0f' if abs(least) >= 1000 else '.4g'}} of {condition}"
                for condition, least in tally.margins.items()
            )
            row = f"{name:{width}}  {tally.percent:3}%  {tally.passed} of {tally.cases}"
            yield row + f"  margin {margins}" * bool(margins)

    def grid(self, rows: int, columns: int) -> tuple[SweptKey, SweptKey, dict[tuple[str, str], CaseTally]] | None:
        """The map: two axes, and what passed at each pair; None without two keys that have several values."""
        if len(self._pair) < 2 or self._search:
            return None
        down, across = self._pair
        first, second = self._axes[down].merged(rows, rows // 2), self._axes[across].merged(columns, columns)
        tallies: dict[tuple[str, str], CaseTally] = {}
        for texts, ok, _ in self._cases:
            place = first.at[texts[down]], second.at[texts[across]]
            tallies.setdefault(place, CaseTally()).take(ok, ())
        return first, second, tallies

    def map(self, *, colours: bool = False) -> Iterator[str]:
        """The lines of the map; the numbers are per cent. Without colours it is plain ASCII."""
        for most in (COLUMNS, COLUMNS // 2, COLUMNS // 4):
            if (grid := self.grid(MOST_GRID_ROWS, most)) is None:
                return
            first, second, tallies = grid
            width, left = max(4, *map(len, second.labels)), max(map(len, (first.name, *first.labels)))
            if left + len(second.labels) * (width + 1) <= WIDTH:
                break
        yield f"per cent that passed: {first.name} down, {second.name} across"
        yield " ".join([f"{first.name:{left}}", *(f"{label:>{width}}" for label in second.labels)])
        for row in first.labels:
            cells = [_cell(tallies.get((row, column)), width, colours) for column in second.labels]
            yield " ".join([f"{row:{left}}", *cells])

    def svg(self) -> str:
        """The map as a picture; empty without one."""
        if (grid := self.grid(MOST_GRID_ROWS, MOST_GRID_ROWS)) is None:
            return ""
        first, second, tallies = grid
        left, top = 20 + 7 * max(map(len, (first.name, *first.labels))), 60
        wide = max(44, 12 + 7 * max(map(len, second.labels)))
        texts = [
            (10, 20, "start", f"per cent that passed: {first.name} down, {second.name} across"),
            *((left + wide * at + wide // 2, 50, "middle", label) for at, label in enumerate(second.labels)),
            *((left - 8, top + 24 * at + 17, "end", label) for at, label in enumerate(first.labels)),
        ]
        parts = []
        for (row, column), tally in tallies.items():
            x, y = left + wide * second.labels.index(column), top + 24 * first.labels.index(row)
            share = tally.passed / tally.cases
            colour = f"rgb({round(178 - 151 * share)},{round(24 + 96 * share)},{round(43 + 12 * share)})"
            parts.append(f'<rect x="{x}" y="{y}" width="{wide - 1}" height="23" fill="{colour}"/>')
            place = f'x="{x + wide // 2}" y="{y + 17}" text-anchor="middle"'
            parts.append(f'<text {place} fill="#fff">{tally.percent}</text>')
        parts += [f'<text x="{x}" y="{y}" text-anchor="{side}">{escape(text)}</text>' for x, y, side, text in texts]
        width, height = max(400, left + wide * len(second.labels) + 10), top + 24 * len(first.labels) + 10
        head = f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" font-family="sans-serif"'
        ground = f'<rect width="{width}" height="{height}" fill="#fff"/>'
        return "\n".join([f'{head} font-size="12">', ground, *parts, "</svg>", ""])

    def boundary(self) -> Iterator[str]:
        """The boundary in words: the values of one key at which a case fails, for those of the other."""
        if self._search:
            first = self._names.index(self._search)
            others = [at for at, axis in enumerate(self._axes) if at != first and len(axis.at) > 1]
            said = self._said(first, others)
            if len(self._axes[first].at) > 1:
                ends, rest = " at both ends of ", "; nothing between was tried"
                said = [
                    ((begin.replace(" at every ", ends), rest) if " every " in begin else (begin, end), place)
                    for (begin, end), place in said
                ]
        elif self._pair:
            said = self._said(self._pair[0], self._pair[1:])
            if all(" every " in begin for (begin, _), _ in said):  # the other key decides
                said = self._said(self._pair[-1], self._pair[:-1])
        else:
            return
        if len({words for words, _ in said}) == 1:
            begin, end = said[0][0]
            yield f"{begin.partition(' at every ')[0]} everywhere" if " every " in begin else f"{begin}{end}"
            return
        for (begin, end), same in groupby(said, key=lambda each: each[0]):
            for place in _joined([place for _, place in same]):
                yield f"{begin} at {place}{end}"

    def _said(self, first: int, others: Sequence[int]) -> list[tuple[tuple[str, str], list[str]]]:
        """Words for the values of a key that fail, at each place: the names and values of other keys."""
        said: dict[tuple[str, ...], dict[str, bool]] = {}
        axes = [self._axes[other].merged(MOST_VALUES, MOST_STRETCHES) for other in others]
        for texts, ok, _ in self._cases:
            place = tuple(axis.at[texts[other]] for other, axis in zip(others, axes, strict=True))
            fails = said.setdefault(place, {})
            fails[texts[first]] = fails.get(texts[first], False) or not ok
        name = self._names[first]
        pairs = ([f"{axis.name} {value}" for axis, value in zip(axes, place, strict=True)] for place in said)
        return [(_words(name, fails), pair) for fails, pair in zip(said.values(), pairs, strict=True)]


def _joined(places: Sequence[Sequence[str]]) -> Iterator[str]:
    """Words for places; those of one key in one, which is named once."""
    if len(places[0]) != 1:
        yield from map(", ".join, places)
        return
    name = places[0][0].partition(" ")[0]
    values = [text.removeprefix(f"{name} ") for (text,) in places]
    yield f"{name} {', '.join(values if len(values) < 4 else [_stretch(values)])}"


def _words(name: str, fails: Mapping[str, bool]) -> tuple[str, str]:
    """Words for the values that fail, before and after those for the place."""
    texts = _sorted(fails)
    failing = [at for at, text in enumerate(texts) if fails[text]]
    numeric = all(_number(text) is not None for text in texts)
    if len(failing) in (0, len(texts)):
        return f"{'fails' if failing else 'passes'} at every {name}", ""
    if numeric and failing == list(range(failing[0], len(texts))):
        return f"fails from {name} {texts[failing[0]]}", " up"
    if numeric and failing == list(range(len(failing))):
        return f"fails from {name} {texts[failing[-1]]}", " down"
    passing = [at for at in range(len(texts)) if at not in set(failing)]
    if numeric and failing[-1] > passing[-1] > failing[0] > passing[0] and len(failing) > SCATTERED:
        return f"fails from {name} {texts[failing[0]]}", f" up in part, and above {texts[passing[-1]]} always"
    runs: list[list[str]] = []
    for before, at in zip([-2, *failing], failing, strict=False):
        if at == before + 1 and numeric:
            runs[-1].append(texts[at])
        else:
            runs.append([texts[at]])
    shown = [_stretch(run) for run in runs]
    more = f" and {len(shown) - SCATTERED} more" if len(shown) > SCATTERED else ""
    return f"fails for {name} {', '.join(shown[:SCATTERED])}{more}", ""


def _cell(tally: CaseTally | None, width: int, colours: bool) -> str:
    text = f"{'' if tally is None else tally.percent:>{width}}"
    if tally is None or not colours:
        return text
    background = 42 if tally.percent == 100 else 43 if tally.percent else 41
    return f"\x1b[30;{background}m{text}\x1b[m"
