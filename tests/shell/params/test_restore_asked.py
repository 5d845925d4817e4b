"""A restore asks before it writes, writes what was shown, reads it back, and says all of it."""

from __future__ import annotations

from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

from multidrop.base.errors import Refused, Stopped
from multidrop.drives.events import Traffic
from tests.support.cell_session import CellSession, bus, party
from tests.support.said import said, texts

pytestmark = pytest.mark.virtual


@pytest.fixture
async def shop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Any]:
    """Drive a has other values than its file `a.toml`."""
    monkeypatch.chdir(tmp_path)
    async with CellSession(tmp_path, bus("line", party("a"), party("b"), baud=0)) as made:
        await said(made, "/params backup a.toml a")
        await said(made, "@a VM=600000")
        await said(made, "@a A=50000")
        made.events.clear()
        yield made


def written(shop: Any) -> list[bytes]:
    """The settings that were written."""
    return [each for each in shop.written("line").split(b"\n") if b"=" in each]


def asks(shop: Any, answer: bool, meanwhile: str = "") -> list[str]:
    """Have a person answer each question, and the drive change while they think."""
    questions: list[str] = []

    async def ask(question: str) -> bool:
        questions.append(question)
        if meanwhile:
            shop.device("line:a").execute(meanwhile, shop.floor.now())
        return answer

    shop.session.questions.agreed, shop.session.front.ask = False, ask
    return questions


SHOWN = ["a: A=1000000 (was 50000)", "a: VM=768000 (was 600000)"]
DONE = "a: 2 settings restored and read back"


async def test_a_yes_writes_what_was_shown_and_nothing_else(shop):
    questions = asks(shop, True)
    assert await said(shop, "/params restore a.toml a") == [
        *SHOWN,
        "- a: 2 settings of a.toml will be written: A, VM: the answer was yes",
        f"! {DONE}; not saved, so lost at power-off: --save keeps it (S)",
    ]
    assert len(questions) == 1
    assert questions[0].startswith("a: 2 settings of a.toml will be written: A, VM")
    assert [each[:-1] for each in written(shop)] == [b"aA=1000000", b"aVM=768000"]


async def test_a_no_writes_nothing(shop):
    asks(shop, False)
    assert await said(shop, "/params restore a.toml a") == [*SHOWN, "x a: the answer was no, so it was not done"]
    assert written(shop) == []


async def test_a_drive_that_changes_while_a_person_thinks_gets_nothing(shop):
    asks(shop, True, "D=77777")
    assert await said(shop, "/params restore a.toml a") == [
        *SHOWN,
        "- a: 2 settings of a.toml will be written: A, VM: the answer was yes",
        "x a: its settings changed meanwhile; nothing was sent; try again",
    ]
    assert written(shop) == []


async def test_a_drive_that_moves_off_while_a_person_thinks_gets_nothing(shop):
    asks(shop, True, "SL 1000")
    with pytest.raises(Refused, match=r"\(nothing was sent\)"):
        await shop.session.run("/params restore a.toml a")
    assert written(shop) == []


async def test_a_drive_that_moves_is_not_asked_about(shop):
    shop.device("line:a").execute("SL 1000", shop.floor.now())
    questions = asks(shop, True)
    with pytest.raises(Refused, match=r"\(nothing was sent\)"):
        await shop.session.run("/params restore a.toml a")
    assert questions == [] and written(shop) == []


async def test_it_is_saved_if_that_is_asked_for(shop):
    assert await said(shop, "/params restore a.toml a --save") == [*SHOWN, f"= {DONE}; saved (S)"]
    device = shop.device("line:a")
    for on in (False, True):
        device.power(on, shop.floor.now())
    assert device.execute("PR VM,A", shop.floor.now()).lines == ("7680001000000",)


@pytest.mark.parametrize(
    ("at", "account"),
    [
        (b"aA=", "0 of 2 steps are done; A=1000000 may be done; nothing was saved; restore again"),
        (b"aVM=", "1 of 2 steps are done: A; VM=768000 may be done; nothing was saved; restore again"),
        (b"aS", "all steps are done; reading back or saving was cut off; restore again to make sure"),
    ],
)
async def test_a_stop_ends_it_and_what_was_written_is_said(shop, at, account):
    def stop(event: object) -> None:
        if isinstance(event, Traffic) and event.outgoing and event.data.startswith(at):
            shop.session.stop()

    shop.events.clear()
    shop.session.buses["line"].watch(stop)
    with pytest.raises(Stopped):
        await shop.session.run("/params restore a.toml a --save")
    assert f"! a: {account}" in texts(shop)


async def test_a_value_that_another_hand_changes_behind_it_is_named_and_nothing_is_saved(shop):
    def change(event: object) -> None:
        if isinstance(event, Traffic) and event.outgoing and event.data.startswith(b"aVM="):
            shop.device("line:a").execute("A=70000", shop.floor.now())

    shop.session.buses["line"].watch(change)
    assert (await said(shop, "/params restore a.toml a --save"))[-1] == (
        "x a: read back after the restore: A is 70000, not 1000000; nothing was saved"
    )
    assert b"aS" not in shop.written("line")


async def test_a_name_that_another_drive_of_the_line_bears_is_not_restored(shop):
    said_ = await said(shop, "/params restore a.toml b --communication")
    assert said_ == ["x a.toml: b: another drive of the line is named a; nothing was sent"]
    assert (await said(shop, "/params restore a.toml a --communication"))[:-1] == SHOWN


async def test_a_file_of_another_product_is_restored_only_if_that_is_asked_for(shop):
    text = Path("a.toml").read_text().replace('"LMDCM"', '"LMDCE"')
    Path("e.toml").write_text(text)
    assert await said(shop, "/params restore e.toml a") == [
        "x e.toml: has the settings of an LMDCE, and a is an LMDCM; nothing was sent; "
        "--other-product restores what both have"
    ]
    assert (await said(shop, "/params restore e.toml a --other-product"))[:2] == SHOWN


async def test_a_setting_that_the_drive_lacks_is_named_with_the_nearest_one(shop):
    strange = Path("a.toml").read_text().replace("VM = 768000", "VMX = 768000")
    Path("s.toml").write_text(strange)
    assert await said(shop, "/params restore s.toml a") == [
        "x s.toml: [parameters] VMX: a has no such setting; did you mean VM?"
    ]
