"""rerun, where it is installed."""

from __future__ import annotations

import os
from typing import Any

import pytest


@pytest.fixture
def rerun() -> Any:
    os.environ["RUST_LOG"] = "off"
    return pytest.importorskip("rerun")
