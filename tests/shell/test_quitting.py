"""What a person is shown of lines that an end leaves unsent or unanswered."""

from __future__ import annotations

import asyncio

import pytest

from multidrop.shell.quitting import Unanswered, not_sent

pytestmark = pytest.mark.virtual


def test_lines_that_are_not_sent_are_named_up_to_ten() -> None:
    assert not_sent([]) == not_sent(["", "  "]) == []
    assert not_sent([" MR 5 ", "", "a\x1bb"]) == [
        "not sent, as multidrop is ending: MR 5",
        "not sent, as multidrop is ending: a\\x1bb",
    ]
    assert not_sent(["MR 5"], "it follows a /quit") == ["not sent, as it follows a /quit: MR 5"]
    ten = [f"MR {number}" for number in range(10)]
    assert not_sent(ten) == [f"not sent, as multidrop is ending: {line}" for line in ten]
    assert not_sent([*ten, "PR P"])[10:] == ["1 more line was not sent"]
    assert not_sent([*ten, "", "PR P", "PR V"])[10:] == ["2 more lines were not sent"]


async def test_an_end_waits_for_the_lines_that_were_sent_but_only_so_long() -> None:
    lines = Unanswered()

    async def send(text: str, seconds: float) -> None:
        with lines.sending(text), lines.sending("one inside of it"):
            await asyncio.sleep(seconds)

    sent = [asyncio.create_task(send(text, seconds)) for text, seconds in ((" MR 5 ", 3.0), ("PR P", 1.0))]
    await asyncio.sleep(0)
    begun = asyncio.get_running_loop().time()
    with lines.sending("/quit"):
        assert await lines.answered(2.0) == ["'MR 5' is not answered yet"]
        assert asyncio.get_running_loop().time() - begun == pytest.approx(2.0)
        assert await lines.answered(10.0) == []
        assert asyncio.get_running_loop().time() - begun == pytest.approx(3.0)
        assert await lines.answered(10.0) == [], "it does not wait for itself"
    await asyncio.gather(*sent)


async def test_an_end_does_not_wait_for_what_the_task_does_once_its_line_is_answered() -> None:
    """The task of a prompt's lines goes on with the next one, which may be the quit."""
    lines = Unanswered()

    async def prompt() -> None:
        with lines.sending("PR P"):
            await asyncio.sleep(0.1)
        await asyncio.sleep(1000.0)

    task = asyncio.create_task(prompt())
    await asyncio.sleep(0)
    begun = asyncio.get_running_loop().time()
    assert await lines.answered(20.0) == []
    assert asyncio.get_running_loop().time() - begun == pytest.approx(0.1)
    task.cancel()
