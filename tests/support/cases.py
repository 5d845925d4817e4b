"""Cases of one statement, run as one test: thousands of tests of their own cost more than what they check."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterable, Sequence
from typing import Any


def for_each(names: str | Sequence[str], cases: Iterable[Any]) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Call a test for each case, as `pytest.mark.parametrize` reads them; a failure names its case."""
    keys = [name.strip() for name in names.split(",")] if isinstance(names, str) else list(names)
    table = [dict(zip(keys, case if len(keys) > 1 else (case,), strict=True)) for case in cases]
    assert table, "no case"

    def fold(test: Callable[..., None]) -> Callable[..., None]:
        @functools.wraps(test)
        def run(**given: Any) -> None:
            for case in table:
                try:
                    test(**given, **case)
                except BaseException as failure:
                    failure.add_note(f"case: {case}")
                    raise

        signature = inspect.signature(test)
        own = [each for name, each in signature.parameters.items() if name not in keys]
        run.__signature__ = signature.replace(parameters=own)  # type: ignore[attr-defined]
        return run

    return fold
