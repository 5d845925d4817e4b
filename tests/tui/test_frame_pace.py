"""The pace of frames in virtual time: terminals that reply, that never do, that cease to, that reply late."""

import pytest

from multidrop.tui.frame_scheduler import MOST_UNANSWERED, REPLY_TIMEOUT, TerminalPace


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
