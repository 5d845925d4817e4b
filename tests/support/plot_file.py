"""What a plot's file holds."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any


def contents(path: Path) -> dict[str, dict[str, list[Any]]]:
    """The values of each component, by entity."""
    from rerun.chunk import RrdReader

    found: dict[str, dict[str, list[Any]]] = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        reader = RrdReader(str(path))
    for chunk in reader.stream():
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            if name.startswith("log_") or "start_time" in name:
                continue
            values = [each.value if name in ("elapsed", "time") else each.as_py() for each in batch.column(name)]
            found.setdefault(str(chunk.entity_path), {}).setdefault(name, []).extend(values)
    return found
