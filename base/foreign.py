"""Functions of features by others: what one raises ends that call alone, and is one line that names the feature.

The registry guards every function in the records of such a feature as it is loaded, so each caller in the core gets one
of the errors that a person reads. Those of the wheel are not guarded: what these raise otherwise is a defect of ours.

A class of records may have a method `passes`: what else its callers expect, by the names of its functions, as in
`{"open": (OSError,)}`.
"""

from __future__ import annotations

import copy
from collections.abc import Awaitable, Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar
from functools import wraps
from inspect import iscoroutinefunction
from os.path import basename
from types import GeneratorType
from typing import Any

from multidrop.base.errors import Diagnostic, DriveError, FeatureFailed, TransportLost, kind_and_text
from multidrop.base.feature import GUARD, Feature, Kinds
from multidrop.base.isolation import LOG, OTHERS, at_once, takes_signals

READ: Kinds = (Diagnostic, DriveError, TransportLost, BrokenPipeError)
"""What passes as it is: the errors that a person reads, and the end of the reader of standard output."""
_calling: ContextVar[ForeignGuard | None] = ContextVar("calling", default=None)


class ForeignGuard:
    """Guards what one feature by others wrote. `name`: that of the feature."""

    def __init__(self, name: str) -> None:
        self._name = name

    @contextmanager
    def calling(self, passes: Kinds = ()) -> Iterator[None]:
        """Call it in the body. Raises Diagnostic for all that it raises besides `READ` and `passes`; an exit, too.

        An interrupt in an event loop is its own, and would end the program without a word: see `takes_signals`.
        """
        before = _calling.get()
        _calling.set(self)
        try:
            yield
        except (*READ, *passes):
            raise
        except (Exception, SystemExit, KeyboardInterrupt) as failure:
            if isinstance(failure, KeyboardInterrupt) and not takes_signals():
                raise  # Ctrl+C
            if LOG.hasHandlers():  # a screen keeps it; elsewhere it would be a traceback
                LOG.getChild(OTHERS).error("the feature %s", self._name, exc_info=failure)
            raise FeatureFailed(
                f"the feature {self._name} failed{_place(failure)}: {kind_and_text(failure)}"
            ) from failure
        finally:
            _calling.set(before)  # not by a token: a task that is thrown away ends in another context

    def function(self, function: Callable[..., Any], passes: Kinds = ()) -> Callable[..., Any]:
        """The function, guarded: also what it awaits, yields, enters and returns in a tuple."""

        @wraps(function)
        async def awaited(*given: Any, **named: Any) -> Any:
            with self.calling(passes):
                return await function(*given, **named)

        @wraps(function)
        def guarded(*given: Any, **named: Any) -> Any:
            with self.calling(passes):
                return self._result(function(*given, **named), passes)

        wrapped = awaited if iscoroutinefunction(function) else guarded
        vars(wrapped)[GUARD] = self
        return wrapped

    def _result(self, found: Any, passes: Kinds) -> Any:
        if isinstance(found, GeneratorType):
            return [*found]
        if isinstance(found, AbstractContextManager):
            return self._entered(found, passes)
        if isinstance(found, Awaitable):
            return self._awaited(found, passes)
        if type(found) is tuple:
            return tuple(self.function(item, passes) if _is_function(item) else item for item in found)
        return found

    async def _awaited(self, work: Awaitable[Any], passes: Kinds) -> Any:
        with self.calling(passes):
            return await work

    @contextmanager
    def _entered(self, manager: AbstractContextManager[Any], passes: Kinds) -> Iterator[Any]:
        with self.calling(passes):
            entered = manager.__enter__()
        failure: BaseException | None = None
        try:
            yield entered
        except BaseException as raised:
            failure = raised
            if not self._left(manager, raised, passes):
                raise
        finally:
            if failure is None:
                self._left(manager, None, passes)

    def _left(self, manager: AbstractContextManager[Any], failure: BaseException | None, passes: Kinds) -> bool:
        with self.calling(passes):
            kind, trace = (type(failure), failure.__traceback__) if failure is not None else (None, None)
            return bool(manager.__exit__(kind, failure, trace))

    def value(self, value: Any, passes: Mapping[str, Kinds], name: str) -> Any:
        """What a record has under a name: a function, or a mapping of functions, is guarded."""
        if _is_function(value):
            return self.function(value, passes.get(name, ()))
        if isinstance(value, Mapping):
            return {key: self.value(item, passes, key) for key, item in value.items()}
        return value

    def record(self, record: Any) -> Any:
        """A record with all its functions guarded: the fields of a named tuple, else the methods of an object.

        These are methods of the object itself, which calls its own ones as they are, and keeps its state.
        """
        passes: Mapping[str, Kinds] = record.passes() if hasattr(record, "passes") else {}
        if isinstance(record, tuple) and hasattr(record, "_fields"):
            fields = zip(record._fields, record, strict=True)
            return type(record)(*(self.value(item, passes, name) for name, item in fields))
        if not hasattr(record, "__dict__"):
            return record
        made = copy.copy(record)
        for name in dir(type(made)):
            if not name.startswith("_") and _is_function(value := getattr(record, name)):
                vars(made)[name] = self.function(value, passes.get(name, ()))
        return made


def guarded(feature: Feature) -> Feature:
    """A feature by others with all its functions guarded."""
    guard = ForeignGuard(feature.name)
    return feature._replace(adds=tuple(map(guard.record, feature.adds)))


def callback(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function to be called later, which is guarded if a feature by others is being called: it is from there.

    Raises Diagnostic for one that is async.
    """
    at_once(function)
    guard = _calling.get()
    return function if guard is None else guard.function(function)


def being_called() -> bool:
    """Whether a feature by others is being called: what is done now is of its doing."""
    return _calling.get() is not None


def _is_function(value: object) -> bool:
    return callable(value) and not isinstance(value, type)


def _place(failure: BaseException) -> str:
    """Where it was raised: ` at lines.py:12`; empty where the call itself was wrong."""
    step = failure.__traceback__
    while step is not None and step.tb_next is not None:
        step = step.tb_next
    if step is None or step.tb_frame.f_code.co_filename == __file__:
        return ""
    return f" at {basename(step.tb_frame.f_code.co_filename)}:{step.tb_lineno}"
