"""Cases of one statement, run as one test: thousands of tests of their own cost more than what they check."""

from __future__ import annotations

import contextlib
import functools
import inspect
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any


def for_each(names: str | Sequence[str], cases: Iterable[Any]) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Call a test for each case, as `pytest.mark.parametrize` reads them; a failure names its case."""
    keys = [name.strip() for name in names.split(",")] if isinstance(names, str) else list(names)
    table = [dict(zip(keys, case if len(keys) > 1 else (case,), strict=True)) for case in cases]
    assert table, "no case"

    def fold(test: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(test)
        def run(**given: Any) -> None:
            for case in table:
                with _named(case):
                    test(**given, **case)

        @functools.wraps(test)
        async def run_async(**given: Any) -> None:
            for case in table:
                with _named(case):
                    await test(**given, **case)

        folded: Any = run_async if inspect.iscoroutinefunction(test) else run
        signature = inspect.signature(test)
        own = [each for name, each in signature.parameters.items() if name not in keys]
        folded.__signature__ = signature.replace(parameters=own)
        return folded

    return fold


@contextlib.contextmanager
def _named(case: dict[str, Any]) -> Iterator[None]:
    try:
        yield
    except BaseException as failure:
        failure.add_note(f"case: {case}")
        raise
