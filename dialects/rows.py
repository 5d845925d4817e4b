"""The tables of the manuals: a `.csv` file beside the module that reads it, with a row for each word or number.

A row may leave out empty cells at its end.
"""

from __future__ import annotations

import csv
import os
from collections.abc import Iterator


def rows(module: str, name: str) -> Iterator[dict[str, str]]:
    """The rows of a table by its head line; `module` is the `__file__` of the reader."""
    with open(os.path.join(os.path.dirname(module), name), encoding="utf-8", newline="") as table:
        yield from csv.DictReader(table, restval="")
