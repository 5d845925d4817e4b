"""Guarded lines: a person is asked once each, a script and a macro are refused, and without a yes nothing is sent."""

import asyncio
from contextlib import asynccontextmanager
from dataclasses import replace

import pytest

from multidrop.base.errors import Diagnostic, Stopped
from multidrop.macros import Macro, MacroStep
from multidrop.shell import configuration
from multidrop.shell.events import By
from multidrop.shell.scripts.executor import play
from tests.support.cell_session import CellSession, bus, party, pmx

pytestmark = pytest.mark.virtual

PRESS, STAGES = bus("press", party("a"), party("b"), baud=0), bus("stages", pmx("00"), baud=0)
GUARDED = {"@a CP": "CP", "@b FD": "FD", "@* MR 5": "can start every drive", "@stages:00 STORE": "STORE"}


class Person:
    """Answers every question in the same way."""

    def __init__(self, shop, answer):
        self.asked, self.answer = [], answer
        shop.session.front.ask, shop.session.questions.agreed = self, False

    async def __call__(self, question):
        self.asked.append(question)
        if self.answer is None:
            await asyncio.Event().wait()
        return self.answer


@asynccontextmanager
async def opened(folder, *buses):
    async with CellSession(folder, *(buses or (PRESS, STAGES))) as shop:
        await asyncio.sleep(1.0)
        shop.events.clear()
        shop.session.questions.agreed = False
        yield shop


def silent(shop):
    return not (shop.written("press") or shop.written("stages"))


@pytest.fixture
async def shop(tmp_path):
    async with opened(tmp_path) as made:
        yield made


async def test_without_anybody_to_ask_nothing_is_sent_and_the_refusal_names_yes(shop):
    for line, part in GUARDED.items():
        with pytest.raises(Diagnostic, match=f"{part}.*nothing was sent; --yes agrees to it"):
            await shop.session.run(line)
    assert silent(shop)


async def test_no_sends_nothing_and_yes_sends_once(shop):
    for answer in (False, True):
        person = Person(shop, answer)
        if answer:
            await shop.session.run("@a CP")
        else:
            with pytest.raises(Diagnostic, match="the answer was no"):
                await shop.session.run("@a CP")
            assert silent(shop)
        assert person.asked == ["press:a: 'CP' erases the program"]
    assert shop.written("press").count(b"CP") == 1


async def test_a_stop_while_it_asks_is_sent_and_the_line_is_not(shop):
    person = Person(shop, None)
    asking = asyncio.create_task(shop.session.run("@* MR 512000"))
    await asyncio.sleep(1.0)
    shop.session.stop()
    with pytest.raises(Stopped):
        await asking
    assert person.asked and shop.session.latched
    assert b"\x1b" in shop.written("press") and b"MR" not in shop.written("press") and not shop.moving()


async def test_a_script_and_a_macro_ask_nobody(shop):
    person = Person(shop, True)
    with pytest.raises(Diagnostic, match="a script cannot ask, nothing was sent; --yes agrees beforehand"):
        await shop.session.run("@a CP", replace(shop.session.origin, by=By.SCRIPT))
    with pytest.raises(Diagnostic, match="a macro cannot ask"):
        await play(shop.session, shop.session.origin, Macro("wipe", (MacroStep(0.0, "@a CP"),)), {})
    assert person.asked == [] and silent(shop)
    shop.session.questions.agreed = True
    await shop.session.run("@a CP", replace(shop.session.origin, by=By.SCRIPT))
    assert b"CP" in shop.written("press") and person.asked == []


async def test_a_refused_line_is_not_recorded(shop):
    await shop.session.run("/record wipe")
    with pytest.raises(Diagnostic):
        await shop.session.run("@a CP")
    await shop.session.run("@a PR P")
    await shop.session.run("/record stop")
    assert [step.line for step in shop.session.macros.load("wipe").steps] == ["@press:a PR P"]


async def test_stops_are_sent_without_a_question(shop):
    person = Person(shop, False)
    for line in ("@* SL 0", "@a SL 0", "@stages:* ABORT", "@stages:* SR0=0", "/stop"):
        await shop.session.run(line)
    assert person.asked == []


async def test_a_line_in_program_mode_is_stored_and_needs_no_yes(shop):
    for line in ("@a PG 1", "@a AS=3", "@a E", "@a PG"):
        await shop.session.run(line)
    assert b"AS=3" in shop.written("press")


async def test_the_configuration_takes_guards_away_and_adds_words(shop):
    found = configuration.parse('[guards]\noff = ["cp", "*"]\nalso = ["S"]', "multidrop.toml")
    shop.session.settings = found
    await shop.session.run("@a CP")
    await shop.session.run("@* P=0")
    await shop.session.run("@* MR 0")
    for line in ("S", "s"):
        with pytest.raises(Diagnostic, match=rf"'{line}' is sent: \[guards\] also has S; nothing was sent"):
            await shop.session.run(f"@a {line}")
    for line in ("FD", "fd"):
        with pytest.raises(Diagnostic, match=f"'{line}' erases all"):
            await shop.session.run(f"@a {line}")


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ('guards = "CP"', "guards is not a table"),
        ("[guards]\nno = []", "no key guards.no; valid: also, off"),
        ('[guards]\noff = "CP"', "guards.off is not a list of words"),
        ('[guards]\noff = ["XX"]', "guards.off: no guard XX; valid: \\*, ADDRESS, AS,"),
        ('[guards]\nalso = ["NONSENSE"]', "guards.also: no drive has a word NONSENSE"),
    ],
)
def test_a_wrong_key_or_word_is_named(text, part):
    with pytest.raises(Diagnostic, match=rf"^multidrop.toml:\d: {part}"):
        configuration.parse(text, "multidrop.toml")


def test_send_and_run_refuse_with_2_before_a_byte_is_sent(multidrop, tmp_path):
    (tmp_path / "wipe.txt").write_text("@a CP\n")
    for given in (["send", "sim:#press", "@a CP"], ["run", "wipe.txt", "--on", "sim:#press"]):
        done = multidrop(*given)
        assert (done.returncode, done.stdout) == (2, "")
        assert done.stderr.count("\n") == 1 and "erases the program" in done.stderr and "--yes" in done.stderr
    assert multidrop("send", "sim:#press", "@a CP", "--yes").returncode == 0


READS, CHANGES = ("@a PR P", "@stages:00 PX", "@a SL 0"), ("@a VM=5000", "@stages:00 EO=1", "@a PR ER", "@b EX G1")


@asynccontextmanager
async def doubted(folder):
    async with opened(folder) as shop:
        for each in shop.session.buses.values():
            shop.session.of(each).doubt = "multidrop.toml:9: guards.also: no drive has a word NOPE"
        yield shop


async def test_a_line_that_lacks_its_guards_is_read_only_without_anybody_to_ask(tmp_path):
    async with doubted(tmp_path) as shop:
        for line in CHANGES:
            with pytest.raises(Diagnostic, match="read only.*multidrop.toml:9.*nothing was sent"):
                await shop.session.run(line)
        with pytest.raises(Diagnostic, match="read only"):
            await shop.session.run("/download nothing.mxt a")
        assert silent(shop)
        for line in READS:
            await shop.session.run(line)
        assert not silent(shop)


async def test_one_yes_takes_the_doubt_from_a_line_and_a_no_leaves_it(tmp_path):
    async with doubted(tmp_path) as shop:
        person = Person(shop, False)
        with pytest.raises(Diagnostic, match="the answer was no"):
            await shop.session.run("@a VM=5000")
        assert silent(shop)
        person.answer = True
        await shop.session.run("@a VM=5000")
        await shop.session.run("@b VM=5000")
        assert len(person.asked) == 2 and b"VM=5000" in shop.written("press")
        await shop.session.run("@stages:00 HSPD=500")
        assert len(person.asked) == 3


@pytest.mark.parametrize("line", ["@a VM=5000", "/download nothing.mxt a"])
async def test_a_stop_together_with_the_yes_sends_nothing(line, tmp_path):
    async with doubted(tmp_path) as shop:

        async def yes(_):
            asyncio.get_running_loop().call_soon(shop.session.stop)  # after the answer, before the line goes on
            return True

        shop.session.front.ask = yes
        with pytest.raises(Stopped):
            await shop.session.run(line)
        assert b"VM=5000" not in shop.written("press")


async def test_neither_a_macro_nor_a_script_can_agree_to_it(tmp_path):
    async with doubted(tmp_path) as shop:
        Person(shop, True)
        with pytest.raises(Diagnostic, match="a macro cannot ask, nothing was sent"):
            await shop.session.run("@a VM=5000", replace(shop.session.origin, by=By.MACRO))
        assert silent(shop)


async def test_text_for_a_raw_line_that_lacks_its_guards_needs_a_yes_too(tmp_path):
    async with opened(tmp_path) as shop:
        await shop.session.run("/use press:a")
        await shop.session.run("/raw on")
        shop.session.of(shop.session.buses["press"]).doubt = "multidrop.toml:9: no word NOPE"
        with pytest.raises(Diagnostic, match="read only.*multidrop.toml:9.*nothing was sent"):
            await shop.session.run("aMR 5")
        assert b"MR 5" not in shop.written("press")
        Person(shop, True)
        await shop.session.run("aMR 5")
        assert b"aMR 5" in shop.written("press")
