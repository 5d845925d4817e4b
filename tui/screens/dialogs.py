"""Screens over the main one: choose a drive, search, name a macro, confirm, help, too small. Escape closes them.

They contain no code for the stop: it is found below every screen, and cancels them.

A key is complete when its action returns (`tui.terminal.keyboard`). So fields and lists call their function and post no
message.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence
from string import ascii_letters
from typing import ClassVar, Generic, NamedTuple, TypeVar

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Vertical, VerticalScroll
from textual.screen import ModalScreen
from textual.widgets import Input, OptionList, Static
from textual.widgets.option_list import Option

from multidrop.base.text import visible
from multidrop.shell.channel import AskedValue
from multidrop.tui.key_table import Keyed, hint
from multidrop.tui.widgets.bars import StopSign

T = TypeVar("T")


REFUSED = Binding(",".join(f"f{number}" for number in range(2, 13)), "refuse", show=False, priority=True)
"""Function keys, which play no macro in front of a question."""


class InputField(Input):
    """A line to type in; Enter hands on its text."""

    def __init__(
        self,
        entered: Callable[[str], Awaitable[None] | None],
        value: str = "",
        *,
        edited: Callable[[str], None] | None = None,
        placeholder: str = "",
        id: str | None = None,
    ) -> None:
        self._entered, self._edited = entered, edited
        super().__init__(value, placeholder, compact=True, id=id)
        self.cursor_blink = False

    def watch_value(self, value: str) -> None:
        if self._edited is not None and self.is_mounted:
            self._edited(value)

    async def action_submit(self) -> None:
        if (done := self._entered(self.value.strip())) is not None:
            await done


class ChoiceList(OptionList):
    """A list to choose from; Enter or a click hands on the number of the option."""

    def __init__(self, options: Sequence[str | Text], taken: Callable[[int], None], *, id: str | None = None) -> None:
        super().__init__(
            *(Option(Text(visible(option)) if isinstance(option, str) else option) for option in options), id=id
        )
        self._taken = taken

    def watch_scroll_y(self, old: float, new: float) -> None:
        super().watch_scroll_y(old, new)
        self.tell_below()

    def on_resize(self) -> None:
        self.tell_below()

    def tell_below(self) -> None:
        """Have the box say how many rows are below, unless it was closed meanwhile."""
        if self.is_attached and isinstance(self.screen, Over):
            self.screen.say_below(round(self.max_scroll_y - self.scroll_y))

    def action_select(self) -> None:
        number = self.highlighted
        if number is not None and not self.get_option_at_index(number).disabled:
            self._taken(number)


class Hint(Static):
    """The last rows of a box: its keys, and before them what became of the last key."""

    def __init__(self, keys: str) -> None:
        super().__init__(keys, classes="keys", markup=False)
        self._keys = keys

    def tell(self, text: str) -> None:
        self.update(Text.assemble((f"{text}\n" if text else "", "bold"), self._keys))


class Over(Keyed, ModalScreen[T], Generic[T]):
    """A screen over the main one, with the app's keys that work everywhere."""

    told = ""
    """What became of the last key, where the box does not show that by itself."""
    SHEET: ClassVar[str] = "box"

    hint = ""
    """The keys at the foot of the box."""

    def say_below(self, rows: int) -> None:
        """Show how many rows of the list are below, beside the keys."""
        for keys in self.query(".keys").results(Static):
            keys.update(f"{self.hint}{f'   ▼ {rows} below' if rows > 0 else ''}" if self.hint else keys.content)

    def on_mount(self) -> None:
        if self.is_attached:  # else it is closed already, by a stop or as the app ends
            self.mount(StopSign())
            self.tell(self.told)
            self.begin()

    def begin(self) -> None:
        """Fill in what the box shows, and give the focus to a part of it. Its parts are there."""

    def tell(self, text: str) -> None:
        """Tell in the box what became of a key; an empty text removes that."""
        self.told = text
        for each in self.query(Hint):
            each.tell(text)


class Dialog(Over[T], Generic[T]):
    """A dialog: Escape closes it with None."""

    def action_leave(self) -> None:
        self.dismiss(None)


class Ask(Dialog[str]):
    """Ask for one line."""

    SHEET = "line"

    def __init__(self, title: str, value: str = "", about: str = "") -> None:
        """Make it; `about` is what is asked for."""
        super().__init__()
        self.heading, self.value = title, value
        self.hint = "   ".join(filter(None, (about, hint("line"))))

    def compose(self) -> ComposeResult:
        with Vertical(classes="box"):
            yield Static(self.heading, classes="title", markup=False)
            yield InputField(self._entered, self.value)
            yield Hint(self.hint)

    def begin(self) -> None:
        self.set_focus(self.query_one(InputField))

    def _entered(self, text: str) -> None:
        self.dismiss(text or None)


class Confirm(Dialog[str]):
    """A question with a few answers, each with its key; Escape returns None.

    The first answer is highlighted. A letter highlights the next answer that begins with it. One that begins none
    leaves nothing to take. An answer may have several rows.
    """

    SHEET = "answers"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding(letter, f"begin('{letter.lower()}')", show=False) for letter in ascii_letters
    ]

    def __init__(self, title: str, lines: Sequence[str], answers: Sequence[tuple[str, str]]) -> None:
        super().__init__()
        self.heading, self.lines, self.answers = title, list(lines), list(answers)

    def compose(self) -> ComposeResult:
        with Vertical(classes="box"):
            yield Static(self.heading, classes="title", markup=False)
            yield Static("\n".join(self.lines), classes="about", markup=False)
            rows = [Text("\n".join(map(visible, text.split("\n"))), overflow="fold") for _, text in self.answers]
            yield ChoiceList(rows, self._taken)
            yield Hint(hint("answers"))

    def begin(self) -> None:
        self.query_one(ChoiceList).highlighted = 0
        self.set_focus(self.query_one(ChoiceList))

    def action_begin(self, letter: str) -> None:
        """Highlight the next answer whose key or text begins with a letter; none where no answer does."""
        options = self.query_one(ChoiceList)
        begun = [n for n, words in enumerate(self.answers) if any(word.lower().startswith(letter) for word in words)]
        at = -1 if options.highlighted is None else options.highlighted
        options.highlighted = next((n for n in begun if n > at), begun[0] if begun else None)

    def _taken(self, number: int) -> None:
        self.dismiss(self.answers[number][0])


class GoOn(Dialog[bool]):
    """A question before a step that needs a yes: y is yes; n, Enter, Escape and a stop are no."""

    SHEET = "question"
    BINDINGS: ClassVar[list[BindingType]] = [REFUSED]

    def __init__(self, question: str, look: Callable[[int], None], room: Callable[[int], None]) -> None:
        """Make the question. `look` scrolls the transcript by pages; `room` leaves rows free above it for the box."""
        super().__init__()
        self.question, self._look, self._room = question, look, room

    def compose(self) -> ComposeResult:
        with Vertical(classes="box"):
            yield Static(visible(self.question), classes="title", markup=False)
            yield ChoiceList(["No, send nothing", "Yes, go on"], self._taken)
            yield Hint(hint("question", escape="no"))

    def on_resize(self) -> None:
        """Leave the rows of the box to it: the lines that lead to the question stay in view below it."""
        self.call_after_refresh(self.make_room)

    def make_room(self) -> None:
        """Leave rows for the box, unless it was closed meanwhile."""
        for box in self.query(".box"):
            self._room(box.outer_size.height + 1)

    def begin(self) -> None:
        self.query_one(ChoiceList).highlighted = 0
        self.set_focus(self.query_one(ChoiceList))

    def _taken(self, number: int) -> None:
        self.dismiss(number == 1)

    def action_answer(self, yes: bool) -> None:
        self.dismiss(yes)

    def action_look(self, pages: int) -> None:
        self._look(pages)

    def action_refuse(self) -> None:
        self.tell("Answer the question first: y or n")


class Match(NamedTuple):
    """A search result: its key and its text."""

    key: str
    text: Text


class SearchDialog(Dialog[str]):
    """Type to narrow a list; returns the key of the chosen result. The key that opened it steps to the next one."""

    SHEET = "list"

    def __init__(self, title: str, find: Callable[[str], Sequence[Match]], take: str = "take") -> None:
        """Make it; `take` is what Enter does."""
        super().__init__()
        self.heading, self.hint = title, f"type to narrow   {hint('list', enter=take)}"
        self._find = find
        self.found: Sequence[Match] = ()

    def compose(self) -> ComposeResult:
        with Vertical(classes="box wide"):
            yield Static(self.heading, classes="title", markup=False)
            yield InputField(self._entered, edited=self._narrow)
            options = ChoiceList((), self._taken)
            options.can_focus = False
            yield options
            yield Hint(self.hint)

    def begin(self) -> None:
        self.set_focus(self.query_one(InputField))
        self._narrow("")

    def _narrow(self, text: str) -> None:
        self.found = self._find(text)
        options = self.query_one(ChoiceList)
        options.clear_options()
        options.add_options([Option(match.text) for match in self.found] or [Option("nothing matches", disabled=True)])
        options.highlighted = 0 if self.found else None
        options.call_after_refresh(options.tell_below)

    def action_step(self, by: int) -> None:
        options = self.query_one(ChoiceList)
        if self.found and options.highlighted is not None:
            options.highlighted = min(max(options.highlighted + by, 0), len(self.found) - 1)

    def _entered(self, text: str) -> None:
        self.query_one(ChoiceList).action_select()

    def _taken(self, number: int) -> None:
        self.dismiss(self.found[number].key)


class ListedChoice(NamedTuple):
    """One of a list: its key, its text, and the words by which it is found; the words of the text if none are given."""

    key: str
    text: str
    words: str = ""


class Choose(SearchDialog):
    """Choose one of a list, which narrows as its words are typed; returns its key. `current` is highlighted first."""

    def __init__(self, title: str, offers: Sequence[ListedChoice], current: str = "") -> None:
        super().__init__(title, lambda typed: offers_like(offers, typed))
        self._current = current

    def _narrow(self, text: str) -> None:
        super()._narrow(text)
        keys = [match.key for match in self.found]
        if not text.strip() and self._current in keys:
            self.query_one(ChoiceList).highlighted = keys.index(self._current)


def offers_like(offers: Sequence[ListedChoice], typed: str) -> list[Match]:
    """The offers that have a word for each typed one that begins with it; first those that have just these words.

    A word never matches inside another one: the `l` of a product would take any drive.
    """
    wanted = typed.replace(":", " ").split()
    ranked: list[tuple[bool, bool, int]] = []
    for number, offer in enumerate(offers):
        words = (offer.words or offer.text).replace(":", " ").split()
        lower = [word.casefold() for word in words]
        if all(any(word.startswith(each.casefold()) for word in lower) for each in wanted):
            same = all(each in words for each in wanted)
            ranked.append((not same, not all(each.casefold() in lower for each in wanted), number))
    return [Match(offers[number].key, Text(visible(offers[number].text))) for *_, number in sorted(ranked)]


LEAST_SIZE = (60, 15)
"""Smallest width and height of the main screen."""


class TooSmall(Over[None]):
    """A notice that the terminal is too small; it closes when the terminal grows."""

    def compose(self) -> ComposeResult:
        yield Static(id="too-small", markup=False)

    def on_resize(self) -> None:
        width, height = self.app.size
        need = f"{LEAST_SIZE[0]}x{LEAST_SIZE[1]}"
        text = f"too small: {need} needed, this is {width}x{height}; ^X still stops"
        self.query_one("#too-small", Static).update(text)


NEEDED = "a value is needed"


class FormDialog(Dialog[dict[str, str]]):
    """Asks for values; returns them by name. Enter takes a value and goes to the next, at the end it takes all."""

    SHEET = "form"
    BINDINGS: ClassVar[list[BindingType]] = [REFUSED]

    def __init__(self, title: str, wanted: Sequence[AskedValue]) -> None:
        super().__init__()
        self.heading, self.wanted = title, list(wanted)
        self._at = 0

    def compose(self) -> ComposeResult:
        """Make a line for each value, with what is valid, and a line for what is wrong."""
        with Vertical(classes="box wide"):
            yield Static(visible(self.heading), classes="title", markup=False)
            with VerticalScroll(classes="form", can_focus=False):
                for number, field in enumerate(self.wanted):
                    yield Static(f"{field.name}: {visible(field.valid)}", classes="about", markup=False)
                    yield InputField(self._entered, field.default or "", id=f"value-{number}")
            yield Static("", id="wrong", markup=False)
            yield Hint(hint("form"))

    def begin(self) -> None:
        needed = [number for number, field in enumerate(self.wanted) if field.default is None]
        self._go(needed[0] if needed else 0)

    def _field(self, number: int) -> InputField:
        return self.query_one(f"#value-{number}", InputField)

    def _go(self, number: int) -> None:
        self._at = number
        self.set_focus(self._field(number))

    def action_step(self, by: int) -> None:
        self._go((self._at + by) % len(self.wanted))

    def action_refuse(self) -> None:
        self.tell("Fill in the form first, or close it with Esc")

    def _entered(self, text: str) -> None:
        if self._is_wrong(self._at):
            return
        if self._at + 1 < len(self.wanted):
            self._go(self._at + 1)
            return
        for number in range(len(self.wanted)):
            if self._is_wrong(number):
                self._go(number)
                return
        self.dismiss({field.name: self._text(number) for number, field in enumerate(self.wanted)})

    def _text(self, number: int) -> str:
        """The value as typed, else the default."""
        return self._field(number).value.strip() or self.wanted[number].default or ""

    def _is_wrong(self, number: int) -> bool:
        """Show what is wrong with a value; whether anything is."""
        field, text = self.wanted[number], self._text(number)
        problem = NEEDED if not text and field.default is None else field.problem(text)
        self.query_one("#wrong", Static).update(f"{field.name}: {problem}" if problem == NEEDED else problem)
        return bool(problem)
