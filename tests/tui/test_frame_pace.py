"""The pace of frames in virtual time: what moves, lines; terminals that reply, never do, cease to, or reply late."""

import asyncio

import pytest

from multidrop.tui.frame_scheduler import MOST_UNANSWERED, REPLY_TIMEOUT, Frames, TerminalPace


class Screen:
    def __init__(self):
        self.now, self.handed_over = 0.0, True
        self.pace = TerminalPace(lambda: self.now, lambda: self.handed_over)

    def frame(self):
        """True if a frame goes out now, with a query after it."""
        if not self.pace.ready():
            return None
        return self.pace.ask()


@pytest.fixture
def screen():
    return Screen()


def answering(screen):
    assert screen.frame() is True
    screen.pace.answered()
    return screen


def test_a_frame_waits_until_the_system_has_taken_the_one_before(screen):
    screen.handed_over = False
    assert screen.frame() is None
    screen.handed_over = True
    assert screen.frame() is True


def test_a_terminal_that_answers_gets_a_frame_for_each_answer(screen):
    answering(screen)
    for _ in range(10):
        screen.now += 0.03
        assert screen.frame() is True
        assert screen.frame() is None
        screen.now += 0.5
        assert screen.frame() is None
        screen.pace.answered()


def test_a_terminal_that_never_answers_gets_every_frame_and_is_asked_a_few_times_only(screen):
    asked = [screen.frame() for _ in range(100)]
    assert None not in asked and asked.count(True) == MOST_UNANSWERED


def test_one_that_ceases_to_answer_is_waited_for_a_few_times_and_then_gets_every_frame(screen):
    answering(screen)
    waited = 0
    for _ in range(MOST_UNANSWERED):
        assert screen.frame() is True
        assert screen.frame() is None
        screen.now += REPLY_TIMEOUT
        waited += 1
    assert waited == MOST_UNANSWERED
    for _ in range(50):
        screen.now += 0.001
        assert screen.frame() is not None
    screen.now += REPLY_TIMEOUT
    assert screen.frame() is True, "it is asked again, should it answer one day"


def test_an_answer_that_comes_late_brings_the_waiting_back(screen):
    answering(screen)
    for _ in range(MOST_UNANSWERED + 1):
        screen.frame()
        screen.now += REPLY_TIMEOUT
    assert screen.frame() is not None
    screen.pace.answered()
    assert screen.frame() is True
    assert screen.frame() is None


class Painted:
    """Frames that are painted at once, and what each of them was."""

    def __init__(self):
        self.behind = False
        self.frames = Frames(self.paint, self.later, lambda: self.behind)
        self.times: list[tuple[int, str]] = []
        """Milliseconds, and `all` or `records`."""
        self.begin = asyncio.get_running_loop().time()

    @staticmethod
    def later(run):
        asyncio.get_running_loop().call_soon(run)
        return True

    def paint(self, panels):
        now = asyncio.get_running_loop().time() - self.begin
        self.times.append((round(1000 * now), "all" if panels else "records"))
        return True


@pytest.mark.virtual
async def test_values_that_change_are_painted_ten_times_a_second_however_often_they_are_read():
    for period in (0.02, 0.05):
        painted = Painted()
        for _ in range(round(2 / period)):
            painted.frames.follow()
            await asyncio.sleep(period)
        assert {what for _, what in painted.times} == {"all"}
        assert 19 <= len(painted.times) <= 21


@pytest.mark.virtual
async def test_the_first_value_after_a_rest_is_painted_at_once():
    painted = Painted()
    await asyncio.sleep(5)
    painted.frames.follow()
    await asyncio.sleep(0.5)
    assert painted.times == [(5000, "all")]


@pytest.mark.virtual
async def test_a_line_waits_for_no_value_and_values_wait_for_no_line():
    painted = Painted()
    await asyncio.sleep(5)
    painted.frames.follow()
    await asyncio.sleep(0.02)
    painted.frames.follow()
    await asyncio.sleep(0.02)
    painted.frames.wake(panels=False)
    await asyncio.sleep(0.5)
    assert painted.times == [(5000, "all"), (5040, "records"), (5100, "all")]


@pytest.mark.virtual
async def test_lines_are_painted_thirty_times_a_second_and_all_with_every_third():
    painted = Painted()
    for _ in range(200):
        painted.frames.wake()
        await asyncio.sleep(0.005)
    assert 28 <= len(painted.times) <= 32
    assert 9 <= [what for _, what in painted.times].count("all") <= 11


@pytest.mark.virtual
async def test_while_lines_wait_for_a_later_frame_only_every_second_one_is_begun():
    painted = Painted()
    painted.behind = True
    for _ in range(200):
        painted.frames.wake(panels=False)
        await asyncio.sleep(0.005)
    assert 14 <= len(painted.times) <= 16
