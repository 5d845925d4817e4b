"""Imports on demand and the collector of garbage."""

import gc
from collections.abc import Iterator

import pytest

from multidrop.base import on_demand
from multidrop.base.on_demand import imported, importing


@pytest.fixture(autouse=True)
def _nothing_is_frozen() -> Iterator[None]:
    frozen = gc.get_freeze_count()
    gc.unfreeze()
    yield
    gc.unfreeze()
    if frozen:
        gc.freeze()
    gc.enable()


def generation(made: object) -> int | None:
    """The generation of an object; None: it is frozen."""
    return next((n for n in range(3) if any(each is made for each in gc.get_objects(generation=n))), None)


def test_what_an_import_makes_is_old_at_once() -> None:
    with importing():
        assert not gc.isenabled()
        made = [object()]
    assert gc.isenabled() and generation(made) == 2


def test_within_another_import_the_outer_one_ends_it() -> None:
    with importing():
        with importing():
            made = [object()]
        assert not gc.isenabled() and generation(made) == 0
    assert generation(made) == 2


def test_what_is_frozen_stays_frozen() -> None:
    kept = [object()]
    gc.freeze()
    with importing():
        made = [object()]
    assert (generation(kept), generation(made)) == (None, None)


def test_what_is_imported_already_leaves_the_collector_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(on_demand, "importing")
    assert imported("multidrop.base.on_demand:imported") is imported
