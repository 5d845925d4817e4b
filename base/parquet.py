"""Parquet files: pyarrow, imported where one is written or read."""

from __future__ import annotations

from typing import Any

from multidrop.base.errors import Diagnostic


def pyarrow(instead: str) -> Any:
    """Import pyarrow. Raises Diagnostic if it is missing; `instead` says what needs none."""
    try:
        import pyarrow as found
        import pyarrow.csv
        import pyarrow.parquet
    except ImportError:
        hint = f"{instead}, or pipx install 'multidrop[rerun]', which brings it"
        raise Diagnostic("Parquet files need pyarrow, which is not installed", hint=hint) from None
    return found
