"""Macros on simulated drives, in virtual time: pace, rounds, values, calls, roles, and what is refused beforehand."""

from __future__ import annotations

import asyncio
import contextlib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic, DriveError
from multidrop.macros import Macro, MacroStep, MacroStore
from multidrop.shell.events import Progressed
from multidrop.shell.scripts.executor import run_script
from multidrop.shell.scripts.model import MacroEnding
from multidrop.shell.scripts.reading import WrongScript, read_macro, read_script, stand_in
from tests.support.macro_shop import Shop

pytestmark = pytest.mark.virtual


async def test_a_step_starts_its_time_after_the_start_of_the_one_before_or_at_its_end(shop: Shop) -> None:
    zero = shop.session.now()
    steps = (
        MacroStep(0.5, "/sleep 0.2"),
        MacroStep(1.0, "/sleep 3"),
        MacroStep(2.0, "/sleep 0"),
        MacroStep(0.5, "/sleep 0.1"),
    )
    await shop.play(Macro("m", steps))
    assert [round(at - zero, 1) for at, _ in shop.begun()] == [0.5, 1.5, 4.5, 5.0]
    shop.events.clear()
    zero = shop.session.now()
    await shop.play(Macro("m", steps), fast=True)
    assert [round(at - zero, 1) for at, _ in shop.begun()] == [0.0, 0.2, 3.2, 3.2]


async def test_rounds_are_counted_and_begin_with_the_same_values(shop: Shop) -> None:
    macro = Macro(
        "m",
        (MacroStep(0, "/set n {start:int} + 1"), MacroStep(0, "/print {n} {start}")),
        on_early_end=("/print never",),
    )
    await shop.play(macro, {"start": "4"}, times=3)
    assert shop.printed() == ["5 4"] * 3
    assert [(each.round, each.line.step) for each in shop.results] == [(1, 2), (2, 2), (3, 2)]
    assert shop.endings == [MacroEnding("m", 3)]
    assert shop.told()[-1].startswith("macro m: 3 rounds played in ")


async def test_without_an_end_it_plays_until_it_is_ended(shop: Shop) -> None:
    shop.save("m", "@a PR P", after=0.5)
    playing = shop.session.start("/play m --times forever")
    await asyncio.sleep(100.2)
    assert shop.session.playing[0].at == "step 1 of 1, round 201"
    await shop.session.run("/play stop m")
    assert not await playing and shop.session.playing == [] and not shop.session.latched


async def test_the_verbs_of_scripts_work_in_a_macro(shop: Shop) -> None:
    lines = ("/repeat {n:int=2}", "@a MR 100", "/wait stopped", "/end", "/assert @a P == {n} * 100 +- 1")
    lines += ("/if @b VM == 700000", '@b PR "go"', '/expect "go"', "/else", "/print no", "/end")
    await shop.play(shop.save("m", *lines))
    assert shop.printed() == ["go"]
    assert [each.line.step for each in shop.results] == [2, 3, 2, 3, 5, 7, 8]


async def test_progress_shows_macro_step_round_and_line(shop: Shop) -> None:
    await shop.play(shop.save("m", "@a PR P", "/sleep 1", "@a PR V", after=0.2, key="F3"), times=2)
    *seen, last = [event for event in shop.events if isinstance(event, Progressed)]
    steps = ("step 1 of 3", "@a PR P"), ("step 2 of 3", "/sleep 1"), ("step 3 of 3", "@a PR V")
    assert [event.text for event in seen] == [
        f"m, {step}, round {number} of 2: {line}" for number in (1, 2) for step, line in steps
    ]
    assert last.over and not any(event.over for event in seen)


async def test_the_step_that_lasts_is_shown_however_fast_it_follows(shop: Shop) -> None:
    inner = shop.save("inner", "/sleep 0", "/sleep 5")
    shop.save("m", "/sleep 0", f"/play {inner.name}", "/sleep 5")
    playing = shop.session.start("/play m")
    for text in ("inner, step 2 of 2: /sleep 5", "m, step 3 of 3: /sleep 5"):
        await asyncio.sleep(4)
        assert [event.text for event in shop.events if isinstance(event, Progressed)][-1] == text
        await asyncio.sleep(2)
    assert await playing


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (("@a MR 1", "/if P"), "macro m, step 2 ({file}:12): /if has no /end"),
        (("@a MR 1", "/waitt stopped"), "macro m, step 2 ({file}:12): no verb /waitt"),
        (("@a MR 1", "/assert 1"), "macro m, step 2 ({file}:12): /assert: "),
        (("@a MR 1", "/play gone"), "macro m, step 2 ({file}:12): "),
        (
            ("@a MR 1", "/play inner --times 0"),
            "macro m, step 2 ({file}:12): /play: 0 is not a number from 1 to 1000000000, or forever",
        ),
        (("@a MR 1", "/play inner x=1"), "macro m, step 2 ({file}:12): macro inner: no line takes the value x"),
        (("@a MR 1", "/play inner n=30"), "macro m, step 2 ({file}:12): macro inner: invalid n = '30'"),
        (("@a MR 1", "/play m"), "macro m, step 2 ({file}:12): /play: m would call itself: m -> m; use /repeat"),
        (("@a MR 1", "@nowhere:a MR 1"), "macro m, step 2 ({file}:12): no bus nowhere; open: press, gantry"),
    ],
)
async def test_what_is_wrong_is_told_with_macro_step_and_file_before_anything_is_sent(
    lines: tuple[str, ...], said: str, shop: Shop
) -> None:
    shop.save("inner", "@a MR {n:int=1,1..20}")
    macro = shop.save("m", *lines)
    with pytest.raises(Diagnostic) as caught:
        await shop.play(macro)
    text = str(caught.value).replace(str(shop.session.macros.path("m")), "{file}")
    assert text.startswith(said)
    assert shop.written("press") == b"" and shop.session.playing == []


async def test_every_error_of_a_macro_and_of_what_it_calls_is_told(shop: Shop) -> None:
    shop.save("far", "/play round")
    shop.save("round", "/call far", "/end")
    macro = shop.save("m", "/if", "/end", "/play round", "/else")
    with pytest.raises(WrongScript) as caught:
        await shop.play(macro)
    told = [str(each).partition(" (")[0] + str(each).partition(")")[2] for each in caught.value.problems]
    assert told == [
        "macro m, step 1: /if: usage: /if EXPR",
        "macro far, step 1: /play: round would call itself: m -> round -> far -> round; use /repeat",
        "macro round, step 2: /end without a block",
        "macro m, step 4: /else without /if",
    ]


async def test_a_macro_is_called_with_values_that_are_known_as_late_as_its_turn(shop: Shop) -> None:
    shop.save("inner", "/print {n:int,5..20}")
    await shop.play(shop.save("m", "/set v 3 * 4", "/call inner n={v}", "/play inner n=5 --times 2"))
    assert shop.printed() == ["12", "5", "5"]
    with pytest.raises(Diagnostic, match="invalid n = '40'; valid: a whole number, 5 to 20") as caught:
        await shop.play(shop.save("late", "/set v 40", "@a PR 1", "/call inner n={v}"))
    assert caught.value.__notes__[0].startswith("macro late, step 3 (")
    assert shop.printed()[-1] == "1"


# -- Roles and the selection


async def test_a_role_is_a_bus_in_lines_verbs_questions_and_called_macros(shop: Shop) -> None:
    lines = ("@line:c MA 300", "/wait stopped", "/assert @line:c P == 300", "/use line:c", "MR 1", "/print {x}")
    inner = shop.save("inner", "/set x @line:c VM", *lines, roles=("line",))
    await shop.play(inner, roles={"line": "gantry"})
    shop.save("outer", "/play inner", roles=("line",))
    await shop.session.run("/play outer line=gantry")
    assert {each.bus for each in shop.results if each.bus} == {"gantry"}
    shop.save("other", "/play inner line=gantry")
    await shop.session.run("/play other")
    with pytest.raises(Diagnostic, match="macro inner: no bus for the role line; --role line=URL opens one"):
        await shop.play(inner)
    with pytest.raises(Diagnostic, match="macro inner: no bus for the role line"):
        await shop.play(shop.save("unbound", "@a MR 5000", "/play inner"))
    assert b"5000" not in shop.written("press")


async def test_lines_and_questions_go_to_the_drive_that_was_selected_as_it_began(shop: Shop) -> None:
    macro = shop.save("n", "/sleep 1", "/set x VM", "PR VM", "/print {x}", "/use b", "PR VM")
    playing = asyncio.create_task(shop.play(macro))
    await asyncio.sleep(0.5)
    shop.session.select("c", "gantry")
    await playing
    assert shop.printed() == ["768000", "768000", "700000"]


async def test_a_called_macro_begins_with_the_selection_of_its_caller(shop: Shop) -> None:
    shop.save("inner", "PR VM", "/use b", "PR VM")
    playing = asyncio.create_task(shop.play(shop.save("m", "/use b", "/sleep 1", "/play inner", "PR VM")))
    await asyncio.sleep(0.5)
    shop.session.select("c", "gantry")
    await playing
    assert shop.printed() == ["700000"] * 3


async def test_a_script_that_calls_a_macro_is_checked_with_its_roles_and_its_end(tmp_path: Path, shop: Shop) -> None:
    shop.save("line", "@line:c PR P", roles=("line",))
    shop.save("back", "@press:b PR P", on_early_end=("@press:b MA 0",))
    for name, said in (("line", "no bus for the role line"), ("back", "b: @press:b MA 0 can start motion")):
        (tmp_path / "s.txt").write_text(f"@press:a MR 7000\n/call {name}\n")
        script = read_script(str(tmp_path / "s.txt"), {}, shop.session.macros)
        with pytest.raises(Diagnostic, match=said):
            await run_script(shop.session, shop.session.origin, script)
    assert shop.written("press") == b""


@given(st.sampled_from(["int", "float", "text", "choice(b|a)"]), st.integers(-9, 9), st.integers(0, 9))
def test_a_value_that_is_not_known_yet_has_a_valid_stand_in(kind: str, low: int, width: int) -> None:
    for limits in ("", f",{low}..{low + width}", f",{low}..", f",..{low}"):
        line = f"MR {{n:{kind}{limits if kind in ('int', 'float') else ''}}}"
        (parameter,) = Macro("m", (MacroStep(0.0, line),)).parameters
        parameter.take(stand_in(parameter))


PIECES = [
    "/if",
    "/repeat",
    "/end",
    "/else",
    "/set",
    "n",
    "{n}",
    "{x:int=3,1..9}",
    "3",
    "P",
    "==",
    "@b",
    "/play",
    "/call",
]
PIECES += [
    "m",
    "other",
    "gone",
    "--times",
    "forever",
    "=",
    "MR 5",
    '"',
    "{",
    "}}",
    "[PR P]",
    "/assert",
    "/expect",
    "",
    "/use",
]


@given(st.lists(st.lists(st.sampled_from(PIECES), max_size=5).map(" ".join), min_size=1, max_size=6))
def test_any_lines_are_checked_without_another_failure_than_a_line_for_a_person(lines: list[str]) -> None:
    class Store(MacroStore):
        def contents(self, name: str) -> bytes | None:
            return b"" if name in ("m", "other") else None

        def load(self, name: str) -> Macro:
            if name not in ("m", "other"):
                raise Diagnostic(f"no macro {name}")
            return Macro(name, (MacroStep(0, "/play m"),) if name == "other" else (MacroStep(0, "PR {n:int,5..7}"),))

    with contextlib.suppress(Diagnostic):
        read_macro(
            Macro("m", tuple(MacroStep(0, line) for line in lines), on_early_end=tuple(lines)), {}, Store(Path("gone"))
        )


async def test_what_a_person_prints_meanwhile_is_no_answer_to_the_macro(shop: Shop) -> None:
    macro = shop.save("m", '@a PR "one"', '/expect "READY" 2')
    playing = asyncio.create_task(shop.play(macro))
    await asyncio.sleep(0.5)
    await shop.session.run('@a PR "READY"')
    with pytest.raises(DriveError, match='wanted "READY" within 2 s, seen "one"'):
        await playing


# -- Two at once


async def test_two_macros_move_different_drives_side_by_side(shop: Shop) -> None:
    shop.save("one", "@press:a SL 1000", "/sleep 2", "@press:a SL 0")
    shop.save("two", "@press:b SL 1000", "/sleep 2", "@press:b SL 0", "@press:a PR P")
    first, second = shop.session.start("/play one"), shop.session.start("/play two")
    await asyncio.sleep(1)
    assert shop.moving() == {"press:a", "press:b"}
    assert await first and await second


@pytest.mark.parametrize(
    ("lines", "before"),
    [
        (("/print begun", "@press:a MR 7000"), []),
        (("/print begun", "@press:* MR 7000"), []),
        (("/print begun", "/use gantry", "/use press:a", "MR 7000"), ["begun"]),
        (("/print begun", "/set n 1", "/if n == 1", "@press:a MR 7000", "/end"), []),
    ],
)
async def test_a_drive_that_a_macro_moves_is_moved_by_no_other(
    lines: tuple[str, ...], before: list[str], shop: Shop
) -> None:
    shop.save("one", "/sleep 2", "@press:a SL 1000", "/sleep 2", "@press:a SL 0")
    first = shop.session.start("/play one")
    await asyncio.sleep(1)
    with pytest.raises(Diagnostic, match="macro one moves it, so nothing was sent; wait for its end, or stop it"):
        await shop.play(shop.save("two", *lines))
    assert shop.printed() == before and b"7000" not in shop.written("press")
    with pytest.raises(Diagnostic, match="macro one is playing"):
        await shop.session.run("/play one")
    await shop.session.run("@press:a PR P")
    assert await first
    await shop.play(shop.session.macros.load("two"))
    assert b"7000" in shop.written("press")


async def test_after_a_macro_that_another_one_calls_the_step_of_the_caller_is_shown_again(shop: Shop) -> None:
    shop.save("inner", "/sleep 5")
    await shop.play(shop.save("outer", "/call inner", "/sleep 5"))
    shown = [(event.text.partition(",")[0], event.over) for event in shop.events if isinstance(event, Progressed)]
    assert [name for name, over in shown if over] == ["inner", "outer"]
    after = shown.index(("inner", True)) + 1
    assert shown[after] == ("outer", False)
    texts = [event.text for event in shop.events if isinstance(event, Progressed)]
    assert texts[after].startswith("outer, step 1 of 2: /call inner")
