"""A shared port with three clients."""

from __future__ import annotations

import pytest

from tests.support.shared_exchange import Port


@pytest.fixture
def port() -> Port:
    return Port()
