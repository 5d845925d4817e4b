"""The prompt without a terminal: lines, stops, the toolbar, a question, and a form whose values are asked for."""

import asyncio
import contextlib
import io
from types import SimpleNamespace

import pytest
from prompt_toolkit.output import ColorDepth

from multidrop.base.errors import Diagnostic, Stopped
from multidrop.macros import Macro, MacroStep
from multidrop.shell.events import Failed, Progressed
from multidrop.shell.macro_arguments import value_fields
from multidrop.shell.prompt import prompt
from multidrop.shell.prompt.terminal_input import TYPING_PAUSE, at_terminal
from multidrop.shell.prompt.view import PlainOutput
from multidrop.shell.verbs.explaining import overview
from tests.shell.prompt.typist import typist as typist_in
from tests.support.until import until

pytestmark = pytest.mark.virtual

LONG = TYPING_PAUSE * 2
FIELDS = value_fields(Macro("m", (MacroStep(0.0, "{turns:int=10,1..100} {mode:choice(a|b)}"),)), {})
TURNS = "macro m: turns, a whole number, 1 to 100 [10]: "


@pytest.fixture
async def typist(tmp_path):
    async with typist_in(tmp_path) as made:
        yield made


async def test_lines_run_in_order_and_are_kept_in_the_history(typist, tmp_path):
    typist.send("/sleep 0\r/help MR\r/drives\r")
    await until(lambda: "/drives" in typist.entered)
    assert typist.entered == ["/sleep 0", "/help MR", "/drives"]
    assert any("MR" in line for line in typist.output)
    typist.send("/quit\r")
    assert await typist.ends() == 0
    assert (tmp_path / "state" / "history").read_text().splitlines() == ["/sleep 0", "/help MR", "/drives", "/quit"]


async def test_the_stop_key_stops_at_once_and_drops_what_waits(typist):
    typist.send("/sleep 1000\r/sleep 2000\r")
    await until(lambda: typist.entered == ["/sleep 1000"])
    typist.send("half a line\x18")
    await until(lambda: typist.session.latched and not typist.session.busy)
    typist.send("\x03/quit\r")
    assert await typist.ends() == 0
    assert "/sleep 2000" not in typist.entered


async def test_the_toolbar_shows_the_progress_of_a_job(typist):
    typist.session.publish(Progressed(0.0, "a: download", 3, 10, 2.0))
    await until(lambda: "a: download: 3 of 10, 2 s left" in typist.screen)
    typist.session.publish(Progressed(0.0, "a: download", 10, 10, 0.0))
    await until(lambda: "download" not in typist.screen)


async def test_the_toolbar_shows_that_a_log_is_on(typist, tmp_path):
    await typist.session.run(f"/log {tmp_path / 'day.jsonl'}")
    await until(lambda: "  log day.jsonl" in typist.screen)
    await typist.session.run("/log off")
    await until(lambda: "log day" not in typist.screen)


async def test_the_toolbar_says_what_is_known_since_a_stop(typist):
    assert "^X STOP ALL  /open" in typist.screen
    typist.session.stop()
    await until(lambda: "^X STOP ALL  · NO STOP SENT   no drive is open       /resume lets" in typist.screen)


async def test_ctrl_c_clears_the_line_or_stops_what_runs(typist):
    typist.send("MR 51200\x03/sleep 1000\r")
    await until(lambda: typist.entered == ["/sleep 1000"])
    typist.send("\x03")
    await until(lambda: typist.session.latched)


async def test_ctrl_d_ends_and_stops_what_still_ran(typist):
    typist.send("/sleep 1000\r")
    await until(lambda: typist.session.busy)
    typist.send("\x04")
    assert await typist.ends() == 0
    await until(lambda: not typist.session.busy)
    assert not typist.session.latched


async def test_ctrl_r_finds_a_line_of_an_earlier_run(tmp_path):
    (tmp_path / "state").mkdir()
    (tmp_path / "state" / "history").write_text("/help VM\n/help MR\n/sleep 0\n")
    async with typist_in(tmp_path) as typist:
        typist.send("\x12help V\r\r")
        await until(lambda: typist.entered)
        typist.send("\x04")
        await typist.ends()
        assert typist.entered == ["/help VM"]


async def test_clear_and_exit_are_verbs(typist):
    typist.send("/clear\r/exit\r")
    assert await typist.ends() == 0
    assert typist.entered == ["/clear", "/exit"]


async def test_a_suggestion_from_the_history_is_taken_by_a_key_and_never_sent_by_enter(tmp_path):
    (tmp_path / "state").mkdir()
    (tmp_path / "state" / "history").write_text("/help MR\n/help VM\n")
    async with typist_in(tmp_path) as typist:
        typist.send("/help ")
        await until(lambda: "> /help VM" in typist.screen)
        typist.send("M\r")
        await until(lambda: typist.entered == ["/help M"])
        await asyncio.sleep(LONG)
        typist.send("/help V")
        await until(lambda: "> /help VM" in typist.screen)
        typist.send("\x1b[C\r")
        await until(lambda: typist.entered == ["/help M", "/help VM"])


async def test_a_value_that_is_asked_for_is_not_completed_from_the_history(tmp_path):
    (tmp_path / "state").mkdir()
    (tmp_path / "state" / "history").write_text("1000\n")
    async with typist_in(tmp_path) as typist:
        asking = asyncio.create_task(typist.session.questions.fill_in("macro m", FIELDS))
        await typist.shows(TURNS.rstrip())
        await asyncio.sleep(LONG)
        typist.send("1")
        await asyncio.sleep(LONG)
        assert typist.screen.startswith(f"{TURNS}1\n")
        typist.send("\x04")
        await asyncio.gather(asking, return_exceptions=True)


async def test_ctrl_c_names_the_drives_that_run_and_the_key_that_stops_them(typist):
    typist.send("/open sim:#press\r@b SL 5000\r")
    await until(lambda: "@b SL 5000" in typist.entered)
    await asyncio.sleep(1)
    typist.send("MR 5\x03")
    await until(lambda: "Ctrl+C stopped nothing; Ctrl+X stops all drives" in typist.notices)
    assert "b moves at 5000 a second" in typist.notices
    assert typist.entered == ["/open sim:#press", "@b SL 5000"] and not typist.session.latched


async def test_ctrl_c_says_nothing_while_all_drives_stand(typist):
    typist.send("/open sim:#press\r")
    await until(lambda: "a>" in typist.screen)
    typist.send("\x03")
    await asyncio.sleep(5)
    assert not any("Ctrl+C" in each for each in typist.notices)


async def test_the_toolbar_counts_the_seconds_of_what_runs(typist):
    typist.send("/sleep 1000\r")
    await until(lambda: "running /sleep 1000, 3 s" in typist.screen)
    typist.send("\x18")
    await until(lambda: "running" not in typist.screen)


async def test_long_help_is_shown_a_screenful_at_a_time_and_any_line_ends_it(typist):
    typist.send("/help\r")
    await until(lambda: any("Enter shows the next of" in each for each in typist.notices))
    first = len(typist.output)
    assert first < typist.app.output.get_size().rows
    typist.send("\r")
    await until(lambda: len(typist.output) > first)
    assert typist.output == overview()[: len(typist.output)]
    typist.send("/help VM\r")
    await until(lambda: any(line.startswith("VM:") for line in typist.output))
    shown = len(typist.output)
    typist.send("\r/sleep 0\r")
    await until(lambda: "/sleep 0" in typist.entered)
    assert len(typist.output) == shown


@pytest.mark.parametrize(
    ("typed", "closes"),
    [("q", True), ("Q", True), ("qq", True), (" q ", True), ("k", False), ("E", False), ("?", False)],
)
async def test_what_is_typed_to_the_pager_is_never_sent(typist, typed, closes):
    typist.send("/help\r")
    await until(lambda: any("q closes the help" in each for each in typist.notices))
    shown, entered = len(typist.output), list(typist.entered)
    typist.send(f"{typed}\r")
    await until(lambda: any("was not sent" in each for each in typist.notices))
    typist.send("\r")
    await until(lambda: closes or len(typist.output) > shown)
    typist.send("/sleep 0\r")
    await until(lambda: "/sleep 0" in typist.entered)
    assert [each for each in typist.entered if each not in ("/sleep 0", *entered)] == []
    assert (len(typist.output) == shown) == closes


async def test_keys_that_go_on_show_more_and_a_command_is_a_command(typist):
    typist.send("/help\r")
    await until(lambda: any("q closes the help" in each for each in typist.notices))
    shown = len(typist.output)
    typist.send("f\r")
    await until(lambda: len(typist.output) > shown)
    failed = []
    typist.session.subscribe(failed.append, Failed)
    typist.send("/sleep 0\rE\r")  # the first one closes the help: E is a command, and no drive is open
    await until(lambda: failed)
    assert not any("was not sent: " in each for each in typist.notices)


async def test_in_raw_mode_help_is_shown_whole_as_enter_sends_a_byte(typist):
    typist.send("/raw open sim:#press\r/help\r")
    await until(lambda: typist.output[-1:] == overview()[-1:])


async def test_no_color_has_no_colours(tmp_path, monkeypatch):
    for name, depth in ("NO_COLOR", ColorDepth.DEPTH_1_BIT), ("OTHER", ColorDepth.DEPTH_8_BIT):
        monkeypatch.delenv("NO_COLOR", raising=False)
        monkeypatch.setenv(name, "")
        async with typist_in(tmp_path) as typist:
            assert (typist.app._color_depth() or ColorDepth.DEPTH_8_BIT) is depth


async def test_a_dumb_terminal_gets_lines_and_an_echo_and_no_escape_sequence(tmp_path, capsys):
    async with typist_in(tmp_path, PlainOutput()) as typist:
        typist.send("/help VM\r")
        await until(lambda: typist.output)
        await asyncio.sleep(1)
        question = asyncio.create_task(typist.session.questions.confirm("CP erases the program", "a"))
        await asyncio.sleep(LONG)
        typist.send("n")
        await asyncio.gather(question, return_exceptions=True)
        typist.send("/quit\r")
        assert await typist.ends() == 0
    printed = capsys.readouterr()
    shown = printed.err
    assert "\x1b" not in shown + printed.out
    for text in ("> /help VM\n", "\na: CP erases the program. Go on? [y/N] \n> /quit"):
        assert text in shown


# A question: one key answers, but no key that was typed before the question could be read.


@contextlib.asynccontextmanager
async def asked(folder):
    """A typist who is asked; the session's task of asking."""
    async with typist_in(folder) as typist:
        question = asyncio.create_task(typist.session.questions.confirm("CP erases the program", "a"))
        await typist.shows("a: CP erases the program. Go on? [y/N]")
        yield typist, question
    await asyncio.gather(question, return_exceptions=True)


async def answers_a_line(typist):
    await typist.shows(">")
    typist.send("/help MR\r")
    await asyncio.sleep(LONG)
    return typist.entered == ["/help MR"]


async def test_one_key_answers(tmp_path):
    async with asked(tmp_path) as (typist, question):
        await asyncio.sleep(LONG)
        typist.send("y")
        await question
        assert await answers_a_line(typist)


async def test_enter_escape_and_ctrl_c_are_no(tmp_path):
    for key in ("n", "\r", "\x1b", "\x03", "\x04"):
        async with asked(tmp_path) as (typist, question):
            await asyncio.sleep(LONG)
            typist.send(key)
            with pytest.raises(Diagnostic, match="the answer was no"):
                await question
            assert not typist.session.latched and typist.entered == []


async def test_what_was_typed_ahead_answers_nothing(tmp_path):
    async with asked(tmp_path) as (typist, question):
        typist.send("/sleep 0\rY100")
        await asyncio.sleep(LONG)
        assert typist.entered == ["/sleep 0"]
        assert typist.notices == ["not sent, as a question came: Y100"]
        typist.send("MR 1y\r")  # no answer: y and Enter come right after other keys
        await asyncio.sleep(LONG)
        assert not question.done() and typist.app.current_buffer.text == ""
        typist.send("y")
        await question


@pytest.mark.parametrize("pause", [0, LONG])
async def test_stop_and_enter_stop_while_a_question_is_open(tmp_path, pause):
    """Where a console swallows Ctrl+X these keys are the stop, typed fast or slowly."""
    async with asked(tmp_path) as (typist, question):
        await asyncio.sleep(LONG)
        typist.send("/stop")
        await asyncio.sleep(pause)
        assert not typist.session.latched
        typist.send("\r")
        await asyncio.sleep(LONG)
        assert typist.session.latched and question.done() and typist.entered == []


async def test_keys_that_edit_a_line_do_nothing_while_a_question_is_open(tmp_path):
    async with asked(tmp_path) as (typist, question):
        await asyncio.sleep(LONG)
        typist.send("\x1b[A\x12\t\x17\x1b[200~MR 5\rMR 6\x1b[201~")
        await asyncio.sleep(LONG)
        assert not question.done() and not typist.app.layout.is_searching
        assert typist.app.current_buffer.text == "" and typist.entered == []


async def test_the_stop_key_goes_first_and_is_no_yes(tmp_path):
    async with asked(tmp_path) as (typist, question):
        await asyncio.sleep(LONG)
        typist.send("\x18")
        with pytest.raises(Stopped):
            await question
        assert typist.session.latched and await answers_a_line(typist)


# A form: each value is asked for until it is valid.


@contextlib.asynccontextmanager
async def filling(folder):
    """A typist who fills in a form; the session's task of asking."""
    async with typist_in(folder) as typist:
        answers = asyncio.create_task(typist.session.tasks.run(typist.session.questions.fill_in("macro m", FIELDS)))
        await typist.shows(TURNS.rstrip())
        yield typist, answers
    await asyncio.gather(answers, return_exceptions=True)


async def typed(typist, *texts):
    for text in texts:
        await asyncio.sleep(LONG)
        typist.send(text)
    await asyncio.sleep(LONG)


async def test_each_value_is_asked_for_until_it_is_valid(tmp_path):
    async with filling(tmp_path) as (typist, answers):
        await typed(typist, "500\r", "\r")
        assert typist.notices == ["macro m: invalid turns = '500'; valid: a whole number, 1 to 100"]
        await typist.shows("macro m: mode, a or b:")
        await typed(typist, "\r", "b\r")
        assert await answers == {"turns": "10", "mode": "b"}
        assert typist.notices[1:] == ["a value is needed; Ctrl+C gives up"] and typist.entered == []
        await typist.shows(">")
        assert list(typist.app.current_buffer.history.get_strings()) == []


async def test_ctrl_c_escape_and_ctrl_d_give_up(tmp_path):
    for key in ("\x03", "\x1b", "\x04"):
        async with filling(tmp_path) as (typist, answers):
            await asyncio.sleep(LONG)
            typist.send("5")
            typist.send(key)
            with pytest.raises(Diagnostic, match="macro m: no values were given; nothing was sent"):
                await answers
            assert not typist.session.latched and typist.running


async def test_what_was_typed_ahead_is_a_line_and_no_value(tmp_path):
    async with filling(tmp_path) as (typist, answers):
        typist.send("/sleep 0\r77")
        await asyncio.sleep(LONG)
        assert typist.entered == ["/sleep 0"] and not answers.done()
        assert typist.notices == ["not sent, as a question came: 77"]


async def test_a_stop_ends_the_form(tmp_path):
    async with filling(tmp_path) as (typist, answers):
        await asyncio.sleep(LONG)
        typist.send("\x18")
        with pytest.raises(Stopped):
            await answers
        assert typist.session.latched
        await typist.shows(">")


@pytest.mark.parametrize(("typed", "answers"), [("\nx\nb\n", {"turns": "10", "mode": "b"}), ("7\n", None), ("", None)])
def test_a_terminal_is_asked_line_by_line(typed, answers, monkeypatch, capsys):
    monkeypatch.setattr("sys.stdin", io.StringIO(typed))
    assert at_terminal("macro m", FIELDS) == answers
    assert TURNS in capsys.readouterr().err


async def test_a_paste_is_entered_line_by_line_with_enter_and_a_hidden_line_in_it_is_named(typist):
    typist.send("\x1b[200~/sleep 0\r/drives\x1b[201~")
    await until(lambda: "/drives" in typist.screen)
    assert typist.entered == []
    typist.send("\r")
    await until(lambda: typist.entered == ["/sleep 0", "/drives"])
    typist.send("\x1b[200~/sleep 1\u2028/sleep 2\x1b[201~")
    await until(lambda: any(text.endswith("; nothing was pasted") for text in typist.notices))
    assert "line separator (U+2028)" in typist.notices[-1]
    assert "/sleep 1" not in typist.screen


async def test_the_keys_of_flow_control_do_nothing(typist):
    typist.send("/drives\x13\x11\r")
    await until(lambda: typist.entered == ["/drives"])


async def test_what_is_wrong_in_the_configuration_is_said_before_anything_is_opened(monkeypatch, capsys):
    def begun(work):
        work.close()
        said.append(capsys.readouterr().err)
        return 3

    said = []
    found = SimpleNamespace(problems=["multidrop.toml:1: frob", "multidrop.toml:2: frob"])
    monkeypatch.setattr(prompt.configuration, "load", lambda lenient: found)
    monkeypatch.setattr(asyncio, "run", begun)
    assert prompt.run(["sim:"]) == 3 and said == ["multidrop.toml:1: frob\nmultidrop.toml:2: frob\n"]
