"""The names that `multidrop run SCRIPT.py` gives its script: `from multidrop.script import session, values`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from multidrop.api.blocking import Session

    session: Session
    """What `--on` and `--role` opened."""
    values: dict[str, str]
    """The values of `--set`."""


if not TYPE_CHECKING:  # else a checker of types would take any name

    def __getattr__(name: str) -> Any:
        if name in ("session", "values"):
            what = f"multidrop.script has a {name} only under `multidrop run SCRIPT.py`; use multidrop.connect"
            raise ImportError(what)
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
