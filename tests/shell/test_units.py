"""Quantities in lines: converted once, checked right before they are sent, refused where the scale does not hold."""

import asyncio
import re
from contextlib import asynccontextmanager
from dataclasses import replace

import pytest

from multidrop.base.errors import Diagnostic, Differs, DriveError, Inexpressible, Refused, Stopped
from multidrop.macros import Macro, MacroStep
from multidrop.shell.events import By, Notified
from multidrop.shell.origin import PERSON
from multidrop.shell.scripts.executor import play, run_script
from multidrop.shell.scripts.reading import read_script
from tests.support.cell_session import CellSession, bus, drive, party, pmx

pytestmark = pytest.mark.virtual

LINE = bus("line", party("a"), party("b"), baud=0)
ARM, MODULE = bus("arm", pmx("00"), baud=0), bus("slide", drive("TMCM-1140", "1"), baud=0)
ANCHORED = {"scale": "5 mm/turn", "zero": "120 mm", "travel": "0..300 mm"}


@asynccontextmanager
async def opened(folder, *buses, **options):
    async with CellSession(folder, *(buses or (LINE,)), **options) as shop:
        await asyncio.sleep(1.0)
        shop.events.clear()
        shop.session.questions.agreed = False
        yield shop


def moves(shop, name="line"):
    """The commands on a bus that are no prints."""
    return [each.decode() for each in re.findall(rb"(?:MR|MA|VM|VI|SL|A|D|P)[ =]-?\d+", shop.written(name))]


async def run(shop, *lines):
    for line in lines:
        await shop.session.run(line)


WORKED = [
    ("@a MR {12.5 mm}", "MR 128000", "12.5 mm"),
    ("@a MA {-1 cm}", "MA -102400", "-10 mm"),
    ("@a SL {-5 mm/s}", "SL -51200", "-5 mm/s"),
    ("@a SL {60 mrpm}", "SL 51200", "5 mm/s"),
    ("@a VM={50 mm/s}", "VM=512000", "50 mm/s"),
    ("@a VI {1 mm/s}", "VI 10240", "1 mm/s"),
    ("@a A={2 m/s2}", "A=20480000", "2000 mm/s2"),
    ("@a D={0.1 m/s2}", "D=1024000", "100 mm/s2"),
    ("@b MR {90 deg}", "MR -12800", "90 deg"),
    ("@b SL {1 rpm}", "SL -853", "5.9977 deg/s"),
    ("@b MR {-1 mturn}", "MR -51200", "360 deg"),
]


@pytest.mark.parametrize(("typed", "sent", "shown"), WORKED)
async def test_a_quantity_is_sent_as_the_number_of_the_drive_and_shown_with_its_value(tmp_path, typed, sent, shown):
    async with opened(tmp_path, units={"a": "5 mm/turn", "b": "-360 deg/turn"}) as shop:
        await run(shop, typed)
        assert moves(shop) == [sent]
        assert f"{sent}   {shown}" in shop.told(Notified)


async def test_encoder_counts_and_another_resolution_are_read_from_the_drive(tmp_path):
    counts, coarse = party("a", EE=1), party("b", MS=16, VM=20000)
    async with opened(
        tmp_path, bus("line", counts, coarse, baud=0), units={"a": "5 mm/turn", "b": "5 mm/turn"}
    ) as shop:
        await run(shop, "@a MR {5 mm}", "@b MR {5 mm}")
        assert moves(shop) == ["MR 4000", "MR 3200"]


async def test_a_controller_is_given_what_its_mode_makes_of_a_target(tmp_path):
    units = {"00.x": {"scale": "0.4 um/step", "zero": "1 mm"}, "00.y": "-1 mm/step"}
    async with opened(tmp_path, ARM, units=units) as shop:
        await run(shop, "ABS", "X{2 mm}Y{4 mm}", "/wait stopped", "INC", "X{2 mm}", "HSPDX={10 mm/s}", "PY={7 mm}")
        lines = re.findall(rb"X-?\d+(?:Y-?\d+)?|[A-Z]+[XY]=\S+", shop.written("arm"))
        assert lines == [b"X2500Y-4", b"X5000", b"HSPDX=25000", b"PY=-7"]
        with pytest.raises(Diagnostic, match=r"ACCX=\{1 m/s2\}: .*no quantity is taken here; nothing was sent"):
            await run(shop, "ACCX={1 m/s2}")
        with pytest.raises(Diagnostic, match="the controller does not report the steps of a turn"):
            await run(shop, "/units 00.x 5 mm/turn")


async def test_a_mode_that_changed_meanwhile_stops_the_line(tmp_path):
    async with opened(tmp_path, ARM, units={"00.x": "1 mm/step"}) as shop:
        await run(shop, "ABS")
        drive = shop.session.drive()
        line = await shop.session.units.line(drive, "X{2 mm}")
        await run(shop, "INC")
        with pytest.raises(Differs, match="ABS or INC was set meanwhile; 'X2' was not sent"):
            await drive.send(line.text, line.check)
        assert b"X2\r" not in shop.written("arm").replace(b"PX2", b"")


async def test_a_module_is_given_units_of_its_chip(tmp_path):
    async with opened(tmp_path, MODULE, units={"1": "360 deg/turn"}) as shop:
        await run(shop, "/units", "MVP REL, 0, {90 deg}", "/wait stopped", "SAP 4, 0, {60 rpm}", "ROR 0, {-1 turn/s}")
        assert "200 full steps a turn are assumed" in shop.printed()[0]
        sent = [each for each in frames(shop.written("slide")) if each[1] in (1, 4, 5)]
        speed = round(51_200 * 2**3 * 2048 * 32 / 16e6)
        assert [int.from_bytes(each[4:8], signed=True) for each in sent] == [12_800, speed, -speed]


def frames(data):
    return [data[at : at + 9] for at in range(0, len(data), 9)]


REFUSED = [
    ("@a R1={1 mm}", "no quantity is taken here; nothing was sent; valid: A, D, MA, MR"),
    ("@a MR {1 mm}+{1 mm}", "no quantity is taken here"),
    ("@a PR {1 mm}", "no quantity is taken here"),
    ("@a MR {3 deg}", "the scale of the axis is 5 mm/turn; nothing was sent"),
    ("@a SL {3 rpm}", "mrpm is the motor's"),
    ("@a MR {3 mm/s}", "is a velocity, not a distance"),
    ("@a VM={-3 mm/s}", "without sign"),
    ("@a MR {0.00001 mm}", "after rounding; nothing was sent"),
    ("@a MR {3 furlong}", "no unit furlong; valid: m, cm"),
    ("@a MR {12,5 mm}", "a number has no comma"),
    ("@a MR {12  mm}", "valid: {NUMBER SPACE UNIT}"),
    ("@a MR { 12 mm}", "valid: {NUMBER SPACE UNIT}"),
    ("@a MR {NaN mm}", "{NaN mm} is not a quantity; nothing was sent"),
    ("@a MR {inf mm}", "{inf mm} is not a quantity; nothing was sent"),
    ("@a MR {-inf mm}", "{-inf mm} is not a quantity; nothing was sent"),
    ("@a MR {--5 mm}", "{--5 mm} is not a quantity; nothing was sent"),
    ("@a MR {1e3 mm}", "{1e3 mm} is not a quantity; nothing was sent"),
    ("@a MR {5 mm", "{5 mm is not a quantity; nothing was sent"),
    ("@a MR {", "{ is not a quantity; nothing was sent"),
    ("@a MR 5}", "} is not a quantity; nothing was sent"),
    ("@a MR {X}", "{X} is not a quantity; nothing was sent"),
    ("@a MR {}", "{} is not a quantity; nothing was sent"),
    ("@a MR {12mm}", "{12mm} is not a quantity; nothing was sent"),
    ("@a MR {{12 mm}}", "is not a quantity; nothing was sent"),
    ("@b MR {NaN mm}", "{NaN mm} is not a quantity; nothing was sent"),
    ("@a MR {1000000 m}", "1000000 m is 10240000000000 for the drive; nothing was sent"),
    ("@a MR {-209716 mm}", "its numbers go from -2147483648 to 2147483647"),
    ("@a SL {9999999 m/s}", "for the drive; nothing was sent"),
    ("@a MR 12.5 mm", "12.5 mm has a unit; nothing was sent; write MR {12.5 mm}"),
    ("@a VM=50mm/s", "write VM={50 mm/s}"),
    ("@b MR {3 mm}", "b has no scale; /units b 5 mm/turn gives it one"),
    ("@* MR {3 mm}", "b has no scale"),
]


@pytest.mark.parametrize(("typed", "named"), REFUSED)
async def test_a_line_that_cannot_be_converted_is_refused_and_nothing_is_sent(tmp_path, typed, named):
    async with opened(tmp_path, units={"a": "5 mm/turn"}) as shop:
        with pytest.raises(Diagnostic) as caught:
            await run(shop, typed)
        assert named in str(caught.value) and "\n" not in str(caught.value)
        assert not shop.written("line")


async def test_everything_else_is_sent_as_it_is(tmp_path):
    lines = ['@a PR "{1 mm}"', '@a PR "12 mm"', "@a MR 12", "@b MR 12", "@a VM=50000", "@a R1=5"]
    written = []
    for units in ({}, {"a": "5 mm/turn"}):
        async with opened(tmp_path, units=units) as shop:
            await run(shop, *lines, "/wait stopped")
            written.append([each for each in shop.written("line").split(b"\n") if b"MS" not in each])
    plain, scaled = ([each for each in lines if b"EF" not in each] for lines in written)
    assert plain == scaled


async def test_no_drive_is_given_a_quantity_that_nothing_has_converted(tmp_path):
    async with opened(tmp_path, units={"a": "5 mm/turn"}) as shop:
        for drive in (shop.session.drive("line", "a"), shop.session.drive("line", "*")):
            with pytest.raises(Inexpressible, match="{3 mm} is not converted here; nothing was sent"):
                await drive.send("MR {3 mm}")
        assert not shop.written("line")


async def test_lines_of_all_drives_need_one_scale_and_check_each_drive(tmp_path):
    same = {"a": "5 mm/turn", "b": "5 mm/turn"}
    async with opened(tmp_path, units=same) as shop:
        shop.session.questions.agreed = True
        await run(shop, "@* MR {1 mm}")
        assert moves(shop) == ["MR 10240"]
        await run(shop, "/wait stopped")
        shop.device("line:b").execute("MS=128", shop.floor.now())
        with pytest.raises(Differs, match="b: MS was 256 and is 128 now.*was not sent"):
            await run(shop, "@* MR {1 mm}")
        assert moves(shop) == ["MR 10240"]
    async with opened(tmp_path, units={"a": "5 mm/turn", "b": "-5 mm/turn"}) as shop:
        shop.session.questions.agreed = True
        with pytest.raises(Diagnostic, match="a and b have different scales; nothing was sent"):
            await run(shop, "@* MR {1 mm}")
        assert not shop.written("line").count(b"MR")


async def test_a_line_of_all_drives_is_not_sent_once_another_line_went_to_one_of_them(tmp_path):
    async with opened(tmp_path, units={"a": "5 mm/turn", "b": "5 mm/turn"}) as shop:
        shop.session.questions.agreed = True
        everyone = shop.session.drive("line", "*")
        line = await shop.session.units.line(everyone, "MR {1 mm}")
        await run(shop, "@b VM=20000")
        with pytest.raises(Differs, match="another line was sent meanwhile; 'MR 10240' was not sent"):
            await everyone.send(line.text, line.check)
        assert b"MR" not in shop.written("line")
        line = await shop.session.units.line(everyone, "MR {1 mm}")
        await everyone.send(line.text, line.check)
        assert moves(shop)[-1] == "MR 10240"


# What the scale rests on


async def by_hand(shop):
    await run(shop, "@a MS=128")


async def by_another_master(shop):
    shop.device("line:a").execute("MS=128", shop.floor.now())


async def by_a_program(shop):
    await run(shop, "@a PG 1", "@a LB G1", "@a MS=128", "@a E", "@a PG", "@a EX G1")
    await asyncio.sleep(1.0)


async def by_restore(shop):
    await run(shop, "/params backup before.toml", "@a MS=128", "/params backup other.toml", "@a MS=256")
    await run(shop, "/units a", "/params restore other.toml")


async def by_encoder(shop):
    await run(shop, "@a EE=1")


@pytest.mark.parametrize("change", [by_hand, by_another_master, by_a_program, by_restore, by_encoder])
async def test_a_changed_setting_refuses_each_quantity_until_a_person_takes_it(tmp_path, monkeypatch, change):
    monkeypatch.chdir(tmp_path)
    async with opened(tmp_path, units={"a": "5 mm/turn"}) as shop:
        shop.session.questions.agreed = True
        await run(shop, "@a MR {1 mm}", "/wait stopped")
        await change(shop)
        before, at = moves(shop), shop.device("line:a").position(shop.floor.now())
        for _ in range(2):
            with pytest.raises(
                Differs, match=r"a: .* was .* and is .* now.*was not sent; /units a takes it as it is now"
            ):
                await run(shop, "@a MR {1 mm}")
        assert moves(shop) == before
        assert shop.device("line:a").position(shop.floor.now()) == at
        shop.events.clear()
        await run(shop, "/units a", "@a MR {1 mm}")
        assert moves(shop) == ["MR 5120" if change is not by_encoder else "MR 800"]


async def test_what_is_accepted_after_a_line_was_converted_does_not_send_it(tmp_path):
    changes = {"MS was 256 and is 128 now": ["@a MS=128", "/units a"], "scale was": ["/units a 4 mm/turn"]}
    async with opened(tmp_path, units={"a": "5 mm/turn"}) as shop:
        drive = shop.session.drive("line", "a")
        for why, change in changes.items():
            line = await shop.session.units.line(drive, "MR {1 mm}")
            await run(shop, *change)
            with pytest.raises(Differs, match=why):
                await drive.send(line.text, line.check)
        assert not [each for each in moves(shop) if each.startswith("MR")]


async def test_in_program_mode_a_quantity_is_refused(tmp_path):
    async with opened(tmp_path, units={"a": "5 mm/turn"}) as shop:
        await run(shop, "@a PG 1")
        shop.events.clear()
        with pytest.raises(Refused, match="a is in program mode, which takes no quantity; nothing was sent"):
            await run(shop, "@a MR {1 mm}")
        assert not shop.written("line")
        await run(shop, "@a PG")


async def test_a_stop_while_the_position_is_read_keeps_the_line_back(tmp_path):
    async with opened(tmp_path, units={"a": ANCHORED}) as shop:
        typed = asyncio.create_task(shop.session.run("@a MR {1 mm}"))
        while b"PR BY,P" not in shop.written("line"):
            await asyncio.sleep(0.001)
        await asyncio.sleep(0.02)  # between the two readings
        shop.session.stop()
        with pytest.raises(Stopped):
            await typed
        assert not moves(shop)


# References


async def test_places_of_the_machine_need_a_reference(tmp_path):
    async with opened(tmp_path, units={"a": ANCHORED}, guards=["TRAVEL"]) as shop:
        for line in ("@a P=0", "@a MS=128", "@a C1=5"):
            await run(shop, line, "/units a")
            with pytest.raises(
                Diagnostic, match="the position of a is not referenced; nothing was sent; home it, or /units"
            ):
                await run(shop, "@a MA {130 mm}")
            await run(shop, "/units here a 120 mm")
        shop.events.clear()
        await run(shop, "@a MA {130 mm}")
        assert len(moves(shop)) == 1


async def test_a_homing_of_another_sender_that_shows_takes_the_reference(tmp_path):
    async with opened(tmp_path, units={"a": ANCHORED, "b": "5 mm/turn"}) as shop:
        await run(shop, "@b PG 1", "@b LB G1", '@b PR "HM 1"', '@b PR "bHM 1"', "@b E", "@b PG", "@b EX G1")
        await asyncio.sleep(1.0)
        assert shop.session.units.referenced(shop.session.drive("line", "a"), "")
        await run(shop, "@b PG 100", "@b LB G2", '@b PR "aHM 1"', "@b E", "@b PG", "@b EX G2")
        await asyncio.sleep(1.0)
        assert "a: 'HM 1' of another sender: its places are not referenced" in shop.warned()
        with pytest.raises(Diagnostic, match="the position of a is not referenced"):
            await run(shop, "@a MA {130 mm}")


async def test_a_place_is_not_sent_once_its_reference_is_lost(tmp_path):
    async with opened(tmp_path, units={"a": ANCHORED}) as shop:
        drive = shop.session.drive("line", "a")
        line = await shop.session.units.line(drive, "MA {130 mm}")
        await run(shop, "@a P=5")
        with pytest.raises(Differs, match="a: its reference was lost meanwhile; 'MA 102400' was not sent"):
            await drive.send(line.text, line.check)
        assert moves(shop) == ["P=5"]


async def test_a_set_position_is_a_reference_where_the_scale_has_no_zero(tmp_path):
    async with opened(tmp_path, units={"a": "5 mm/turn"}) as shop:
        drive = shop.session.drive("line", "a")
        drive.state.reference_lost([""])
        with pytest.raises(Diagnostic, match="not referenced"):
            await run(shop, "@a MA {1 mm}")
        await run(shop, "@a P=0", "@a MA {1 mm}")
        assert moves(shop) == ["P=0", "MA 10240"]


async def test_here_gives_the_position_at_rest_a_place(tmp_path):
    async with opened(tmp_path, units={"a": "5 mm/turn"}) as shop:
        await run(shop, "@a MR 51200", "/wait stopped", "/units here a 10 mm", "@a MA {0 mm}", "/wait stopped")
        assert moves(shop) == ["MR 51200", "MA -51200"]
        assert (await shop.session.drive("line", "a").motion())[0].position == -51200


# Travel

LEAVING = ["MA {301 mm}", "MA 1843201", "MR {181 mm}", "MR -1300000"]


@pytest.mark.parametrize("line", LEAVING)
async def test_a_move_that_leaves_the_travel_is_asked_about_and_yes_does_not_include_it(tmp_path, line):
    async with opened(tmp_path, units={"a": ANCHORED}) as shop:
        shop.session.questions.agreed = True
        for by in (By.OPERATOR, By.SCRIPT, By.MACRO):
            with pytest.raises(Diagnostic, match="the travel is 0 mm to 300 mm; .*nothing was sent; --beyond agrees"):
                await shop.session.run(f"@a {line}", replace(shop.session.origin, by=by))
        assert not moves(shop)
        asked = []

        async def ask(question):
            asked.append(question)
            return True

        shop.session.front.ask = ask
        await run(shop, f"@a {line}")
        assert len(asked) == 1 and len(moves(shop)) == 1


async def test_beyond_agrees_beforehand_and_the_guard_can_be_off(tmp_path):
    async with opened(tmp_path, units={"a": ANCHORED}) as shop:
        shop.session.questions.beyond = True
        await shop.session.run("@a MA {301 mm}", replace(shop.session.origin, by=By.SCRIPT))
        assert moves(shop)
    async with opened(tmp_path, units={"a": ANCHORED}, guards=["TRAVEL"]) as shop:
        await shop.session.run("@a MA {301 mm}", replace(shop.session.origin, by=By.SCRIPT))
        assert moves(shop)


async def test_a_move_within_the_travel_or_back_towards_it_is_allowed(tmp_path):
    async with opened(tmp_path, units={"a": ANCHORED}) as shop:
        await run(shop, "@a MA {300 mm}", "/wait stopped 100")
        shop.session.questions.beyond = True
        await run(shop, "@a MR {20 mm}", "/wait stopped")
        shop.session.questions.beyond = False
        await run(shop, "@a MR {-10 mm}", "/wait stopped")
        with pytest.raises(Diagnostic, match="the travel is"):
            await run(shop, "@a MR {1 mm}")


LIMITED = {"scale": "1 mm/step", "travel": "0..100 mm"}


async def test_travel_of_a_controller_follows_its_mode_axis_by_axis(tmp_path):
    async with opened(tmp_path, ARM, units={"00.x": LIMITED, "00.y": "1 mm/step"}) as shop:
        await run(shop, "ABS", "X50Y5000", "/wait stopped", "Y-5000", "/wait stopped", "X60", "/wait stopped", "INC")
        for line in ("X41", "X{41 mm}Y1", "I-61:0"):
            with pytest.raises(Diagnostic, match="00.x: .*the travel is 0 mm to 100 mm; nothing was sent"):
                await run(shop, line)
        await run(shop, "X40", "/wait stopped")
        assert (await shop.session.drive().motion())[0].position == 100


async def test_travel_of_a_module(tmp_path):
    async with opened(tmp_path, MODULE, units={"1": LIMITED}) as shop:
        await run(shop, "MVP ABS, 0, 100", "/wait stopped")
        for line in ("MVP REL, 0, 1", "MVP ABS, 0, -1", "SAP 0, 0, 101"):
            with pytest.raises(Diagnostic, match="the travel is 0 mm to 100 mm"):
                await run(shop, line)
        await run(shop, "MVP REL, 0, {-1 cm}")


async def test_a_line_for_all_drives_is_asked_about_for_each_axis(tmp_path):
    async with opened(tmp_path, units={"a": ANCHORED, "b": {**ANCHORED, "travel": "0..200 mm"}}) as shop:
        shop.session.questions.agreed = True
        with pytest.raises(Diagnostic, match="b: 'MA 1024000' ends at 220 mm, and the travel is 0 mm to 200 mm"):
            await run(shop, "@* MA 1024000")
        assert not moves(shop)
        await run(shop, "@* MA 800000")
        assert moves(shop) == ["MA 800000"]


async def test_a_place_is_known_although_the_drive_moves(tmp_path):
    async with opened(tmp_path, units={"a": ANCHORED}) as shop:
        await run(shop, "@a MA {299 mm}")
        await asyncio.sleep(0.5)
        with pytest.raises(Diagnostic, match="the travel is 0 mm to 300 mm"):
            await run(shop, "@a MA {301 mm}")
        await run(shop, "@a MR {200 mm}")
        assert any("travel not checked: it moves" in text for text in shop.told(Notified))


async def test_what_moves_beyond_any_check_is_said_to_be_unchecked(tmp_path):
    program = 'program_text = """PG 1\nLB G1\nH 500\nE\nPG\n"""'
    for line, why in (
        ("@a MR R1", "the end of 'MR R1' is not known"),
        ("@a EX G1", "the end of 'EX G1' is not known"),
        ("/trace G1", "what a program does is not known"),
    ):
        async with opened(tmp_path, bus("line", party("a", program), baud=0), units={"a": ANCHORED}) as shop:
            await run(shop, line)
            told = [e for e in shop.events if isinstance(e, Notified) and "travel not checked" in e.text]
            assert [(e.text, e.warning) for e in told] == [(f"a: travel not checked: {why}", True)]


async def test_an_end_that_is_not_known_is_said_once(tmp_path):
    async with opened(tmp_path, units={"a": ANCHORED}) as shop:
        await run(shop, "@a SL 1000", "@a SL 2000", "@a MR 5", "@a SL 0")
        told = [text for text in shop.told(Notified) if "travel not checked" in text]
        assert told == ["a: travel not checked: the end of 'SL 1000' is not known"]


# Scripts, macros, conditions


async def test_a_script_keeps_quantities_and_a_value_may_be_one(tmp_path):
    file = tmp_path / "moves.txt"
    file.write_text(
        "@a MR {X}\n/wait stopped\n@a MR {2 mm}\n/wait @a P > {2.9 mm} 5\n/assert @a P > {2.9 mm}\n/wait stopped\n"
        "/assert @a P == {3 mm} +- {0.1 mm}\n/print {X}\n/if {2 mm} < @a P\n@a VM={10 mm/s}\n/end\n"
    )
    async with opened(tmp_path, units={"a": "5 mm/turn"}) as shop:
        script = read_script(str(file), {"X": "1 mm"})
        results = []
        await run_script(shop.session, shop.session.origin, script, results.append)
        assert moves(shop) == ["MR 10240", "MR 20480", "VM=102400"]
        assert "1 mm" in shop.printed()


async def test_a_condition_with_a_quantity_fails_and_is_refused_as_a_line_is(tmp_path):
    async with opened(tmp_path, units={"a": "5 mm/turn"}) as shop:
        for line, named in (
            ("/assert @a P > {2.9 mm}", "wanted > 29696, seen 0 (0 mm)"),
            ("/assert @a P > {3 deg}", "the scale of the axis is 5 mm/turn"),
            ("/assert @a P + 1 > {3 mm}", "is not compared with one word of a drive"),
            ("/assert @a R1 > {3 mm}", "prints no quantity"),
        ):
            (tmp_path / "one.txt").write_text(line)
            with pytest.raises((Diagnostic, DriveError)) as caught:
                await run_script(shop.session, PERSON, read_script(str(tmp_path / "one.txt"), {}), [].append)
            assert named in str(caught.value)
        await run(shop, "@a MS=128")
        (tmp_path / "one.txt").write_text("/assert @a P < {2.9 mm}")
        with pytest.raises(Differs, match="MS was 256 and is 128 now"):
            await run_script(shop.session, PERSON, read_script(str(tmp_path / "one.txt"), {}), [].append)


async def test_a_recorded_macro_has_the_quantity_as_typed_and_plays_it(tmp_path):
    async with opened(tmp_path, units={"a": "5 mm/turn"}) as shop:
        shop.session.recorder.start("m", shop.session.now())
        await run(shop, "@a MR {1 mm}", "/wait stopped")
        macro = shop.session.recorder.macro()
        assert [step.line for step in macro.steps] == ["@a MR {1 mm}", "/wait stopped"]
        shop.session.recorder.discard()
        await play(shop.session, shop.session.origin, macro, {}, fast=True)
        await play(
            shop.session, shop.session.origin, Macro("n", (MacroStep(0.0, "@a MR {X}"),)), {"X": "2 mm"}, fast=True
        )
        assert moves(shop) == ["MR 10240", "MR 10240", "MR 20480"]


async def test_a_scale_carries_doubt_once_a_program_began_to_run(tmp_path):
    async with opened(tmp_path, units={"a": "5 mm/turn"}) as shop:
        drive, units = shop.session.drive("line", "a"), shop.session.units
        assert units.of(drive).sure
        await run(shop, "@a PG 1", "@a LB G1", "@a H 500", "@a E", "@a PG", "@a EX G1")
        assert not units.of(drive).sure
        await asyncio.sleep(1.0)
        assert not units.of(drive).sure
        await run(shop, "/units a")
        assert units.of(drive).sure and units.of(drive).measure.shown(51200) == "5 mm"


async def test_a_scale_for_no_drive_is_said(tmp_path):
    async with CellSession(tmp_path, LINE, units={"q": "5 mm/turn", "a.x": "5 mm/turn"}) as shop:
        pass
    async with CellSession(tmp_path, LINE, units={"q": "5 mm/turn", "a.x": "5 mm/turn"}) as shop:
        shop.session.events = shop.events
        await shop.session.units.opened(shop.session.bus())
        assert shop.warned() == [
            "line: units has q, which no drive there is",
            "line: units has a.x, which no drive there is",
        ]
