"""A question is answered by a person or beforehand by --yes; a stop, an interruption or nobody there is no yes."""

import asyncio

import pytest

from multidrop.base.errors import Diagnostic, Stopped
from multidrop.shell.configuration import Settings
from multidrop.shell.prompt.terminal_input import TYPING_PAUSE, TypedAnswer, at_keyboard
from multidrop.shell.session import Session

pytestmark = pytest.mark.virtual

WHAT = "CP erases the program"


@pytest.fixture
def made(tmp_path):
    return lambda: Session(Settings(folder=tmp_path / "config", state=tmp_path / "state"))


class Person:
    """Is asked, and answers when told to."""

    def __init__(self, session):
        self.asked, self.answers, self.open = [], asyncio.Queue(), 0
        session.front.ask = self

    async def __call__(self, question):
        self.asked.append(question)
        self.open += 1
        try:
            return await self.answers.get()
        finally:
            self.open -= 1


async def test_yes_goes_on_and_no_names_yes_on_a_command_line(made):
    session = made()
    person = Person(session)
    person.answers.put_nowait(True)
    await session.questions.confirm(WHAT, "a")
    session.front.beforehand = "--yes agrees beforehand"
    for beforehand in ("; --yes agrees beforehand", ""):  # of a command, of the prompt
        person.answers.put_nowait(False)
        with pytest.raises(Diagnostic, match=f"^a: the answer was no, so it was not done{beforehand}$"):
            await session.questions.confirm(WHAT, "a")
        session.front.beforehand = ""
    assert person.asked == [f"a: {WHAT}"] * 3


async def test_nobody_there_is_no_and_agreed_asks_nobody(made):
    session = made()
    with pytest.raises(Diagnostic, match=f"^{WHAT}; nothing was sent; --yes agrees to it$"):
        await session.questions.confirm(WHAT)
    with pytest.raises(Diagnostic, match=f"^{WHAT}; nothing more was sent; --yes agrees to it$"):
        await session.questions.confirm(WHAT, so_far="nothing more was sent")
    person, session.questions.agreed = Person(session), True
    await session.questions.confirm(WHAT)
    assert person.asked == []


async def test_each_question_of_a_session_has_its_own_answer(made):
    session = made()
    person, questions = Person(session), session.questions
    for answer in (True, False, True, False, True):
        person.answers.put_nowait(answer)
    asked = (*(questions.confirm(WHAT, where) for where in "aab"), questions.agrees("again"), questions.agrees("again"))
    found = await asyncio.gather(*asked, return_exceptions=True)
    assert [type(each) for each in found[:3]] == [type(None), Diagnostic, type(None)]
    assert found[3:] == [False, True]
    assert person.asked == [f"a: {WHAT}", f"a: {WHAT}", f"b: {WHAT}", "again", "again"]
    assert not (questions.agreed or questions.beyond)


class Keys:
    """A keyboard. What is pressed waits until it is taken, or forgotten."""

    def __init__(self):
        self.waiting, self.listener = [], lambda: None

    def press(self, key):
        self.waiting.append(key)
        self.listener()

    def forget(self):
        self.waiting.clear()

    def take(self):
        taken, self.waiting = self.waiting, []
        return taken

    def listen(self, listener):
        before, self.listener = self.listener, listener
        return before


async def test_keys_from_before_a_question_and_behind_the_answer_to_another_one_do_not_answer_it(capsys):
    keys, found = Keys(), []
    for early, key in (("", "y"), ("y", "n"), ("yy", "\r"), ("n", "Y")):
        for each in early:
            keys.press(each)
        asking = asyncio.create_task(at_keyboard(keys, "FD erases the drive"))
        await asyncio.sleep(2 * TYPING_PAUSE)
        assert not asking.done()
        keys.press(key)
        keys.press("y")
        found.append(await asking)
    assert found == [True, False, False, True]
    assert keys.waiting == [] and capsys.readouterr().err.count("FD erases the drive") == 4


async def test_a_stop_ends_the_open_question_and_those_that_wait(made):
    session = made()
    person = Person(session)
    asking = [asyncio.create_task(session.questions.confirm(f"{n}")) for n in range(3)]
    await asyncio.sleep(0.1)
    assert person.asked == ["0"] and not session.busy
    session.stop()
    found = await asyncio.gather(*asking, return_exceptions=True)
    assert [type(each) for each in found] == [Stopped] * 3
    assert str(found[0]) == "not done, as a stop came before the answer"
    assert person.asked == ["0"] and person.open == 0


async def test_an_interruption_ends_the_question(made):
    session = made()
    person = Person(session)
    asking = asyncio.create_task(session.questions.confirm(WHAT))
    await asyncio.sleep(0.1)
    session.interrupt()
    assert isinstance((await asyncio.gather(asking, return_exceptions=True))[0], asyncio.CancelledError)
    assert person.open == 0


def test_only_a_key_after_a_pause_answers():
    for key, meant in {"y": True, "Y": True, "n": False, "\r": False, "\x1b": False, "\x03": False, "x": None}.items():
        assert TypedAnswer(0.0).key(key, TYPING_PAUSE) is meant
        assert TypedAnswer(0.0).key(key, TYPING_PAUSE * 0.9) is None
    answer = TypedAnswer(0.0)
    assert [answer.key(key, TYPING_PAUSE * at) for key, at in (("y", 0.9), ("y", 1.8), ("y", 2.9))] == [
        None,
        None,
        True,
    ]
