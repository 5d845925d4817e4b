"""A moving picture as one SVG: rows of a terminal that appear and go by the clock of CSS, without a script.

A row that several frames show is in the file once for each time that it is shown without a break.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

_ROW = 24.4
"""The height of a row in Rich's pictures."""
_STYLE = re.compile(r"\.(terminal-r\d+) \{ (.*?) \}")
_RECT = re.compile(r'<rect [^>]*\by="([\d.]+)"[^>]*/>')
_TEXT = re.compile(r'<text class="(terminal-r\d+)"([^>]*) clip-path="url\(#terminal-line-(\d+)\)">(.*?)</text>', re.S)
_INNER = '<g transform="translate(9, 41)" clip-path="url(#terminal-clip-terminal)">'
LAST = 3.0
"""Seconds for which the last frame stays."""


def moving(frames: Sequence[tuple[float, str]]) -> str:
    """Join pictures of one size, each with the second at which it begins, into one that repeats."""
    styles, shown = dict[str, str](), dict[tuple[int, str], list[list[float]]]()
    end = frames[-1][0] + LAST
    ends = [at for at, _ in frames[1:]] + [end]
    for (begin, svg), until in zip(frames, ends, strict=True):
        for row in _rows(svg, styles).items():
            times = shown.setdefault(row, [])
            if times and times[-1][1] == begin:
                times[-1][1] = until
            else:
                times.append([begin, until])
    groups, rules = list[str](), dict[str, str]()
    for (_, row), times in shown.items():
        for begin, until in times:
            name = f"t{begin * 100:.0f}-{until * 100:.0f}"
            if (begin, until) != (0.0, end):
                rules[name] = _rule(name, begin / end, until / end, end)
            groups.append(f'<g class="{name}">{row}</g>' if name in rules else row)
    head, _, rest = frames[0][1].partition(_INNER)
    head = _STYLE.sub("", head)
    fills = "".join(f".{name} {{ {style} }}\n" for style, name in styles.items())
    css = head.replace("</style>", fills + "".join(rules.values()) + "</style>", 1)
    return f'{css}{_INNER}<g class="terminal-matrix">\n' + "\n".join(groups) + "\n</g></g>\n</svg>\n"


def _rows(svg: str, styles: dict[str, str]) -> dict[int, str]:
    """The rows of a picture by their number, with names of styles that all frames share."""
    head, _, body = svg.partition(_INNER)
    named = dict(_STYLE.findall(head))
    found = dict[int, list[str]]()
    for rect in _RECT.finditer(body):
        found.setdefault(round((float(rect[1]) - 1.5) / _ROW), []).append(rect[0])
    for kind, places, line, text in _TEXT.findall(body):
        if text.strip():
            name = styles.setdefault(named[kind], f"s{len(styles)}")
            clip = f'clip-path="url(#terminal-line-{line})"'
            found.setdefault(int(line), []).append(f'<text class="{name}"{places} {clip}>{text}</text>')
    return {number: "".join(parts) for number, parts in found.items()}


def _rule(name: str, begin: float, until: float, seconds: float) -> str:
    """The style of a row that is visible from one part of the time to another."""
    steps = "" if begin == 0 else "0% { visibility: hidden } "
    steps += f"{begin:.3%} {{ visibility: visible }} "
    steps += "" if until >= 1 else f"{until:.3%} {{ visibility: hidden }} "
    last = "visible" if until >= 1 else "hidden"
    return (
        f"@keyframes {name} {{ {steps}100% {{ visibility: {last} }} }}\n"
        f".{name} {{ visibility: hidden; animation: {name} {seconds:.2f}s step-end infinite }}\n"
    )
