"""The page of variables: those of the programs in the selected drive, searched and edited.

`/variables` reads them. A value is checked before anything is sent; a second Enter sends the line that is shown, and
then everything is read again.
"""

from __future__ import annotations

from collections.abc import Sequence

from multidrop.base.errors import Diagnostic, Inexpressible
from multidrop.dialects.by_hand import ByHand, Variable
from multidrop.tui.panels.view import Glance, View, name_of
from multidrop.tui.screens.page import ListPage, PageHost, SendingPage, note_painted
from multidrop.tui.text import age, fit
from multidrop.tui.widgets.lines import Row, Span, spread

NAME, VALUE = 8, 14
EDIT, KEEP = "value", "keep"
READING = "reading; the footer shows how far"


def narrowed(variables: Sequence[Variable], words: str) -> list[Variable]:
    """The variables that have every typed word in name, value or comment; one with just that name first."""
    wanted = words.casefold().split()
    found = [
        each for each in variables if all(word in f"{each.name} {each.value} {each.kept}".casefold() for word in wanted)
    ]
    return sorted(found, key=lambda each: each.name.casefold() != words.strip().casefold())


class VariablesPage(ListPage, SendingPage):
    """The variables of the selected drive."""

    SHEET = "variables"
    WANTS = frozenset({"motion"})
    PARTS = {"heading": None, "asked": None, "columns": None, "table": "1fr", "said": None}
    FIELD, LIST = "asked", "table"

    def __init__(self, host: PageHost) -> None:
        super().__init__(host)
        self._at = 0
        self._words = ""
        self._asked_for = False
        """They were asked for, as they were not read yet."""
        self._again = False
        """They are to be read again once no line runs or waits."""
        self._place = host.session.place
        self._glance: Glance | None = None

    @property
    def words(self) -> str:
        return self._words

    # What is shown

    def show(self, view: View) -> None:
        self._glance = view.chosen
        place, idle = view.session.place, self.host.outbox.idle
        if place != self._place:
            self._place, self._at, self._asked_for = place, 0, False
            self._close("")
        if any(each is not None and each.stops != view.session.stops for each in (self.asked, self.begun)):
            self._close("stopped; nothing was sent")
        if view.model.trouble:
            self.say(f"✗ {view.model.trouble}")
            view.model.trouble = ""
        if self._again and idle:
            self._again = False
            self.host.outbox.type("/variables")
        every = self._variables()
        if self._glance is not None and every is None and not self._asked_for and idle:
            self._asked_for = True
            self.action_read()
        if self.said[0] == READING and every is not None and idle:
            self.say("", "dim")
        shown = self._shown()
        self._at = min(self._at, max(0, len(shown) - 1))
        nothing: list[Row] = [((f" {self._nothing()}", "dim"),)]
        below = self.put_rows(shown, self._at, self._row, nothing)
        self.lines("heading").put([self._heading(view, below, len(shown))])
        columns = f"  {fit('name', NAME)} {'value':>{VALUE}}  after a power-off"
        self.lines("columns").put([((fit(columns, self.size.width), "dim"),)])
        self.lines("said").put([((f" {fit(self.said[0], self.size.width - 2)}", self.said[1]),)])
        note_painted(self)

    def _heading(self, view: View, below: Span, count: int) -> Row:
        glance = self._glance
        name = f"{view.session.selected_bus}:{name_of(glance)}" if glance is not None else "no drive selected"
        left: list[Span] = [(" VARIABLES   ", "strong"), (name, "accent")]
        every = self._variables()
        if glance is None or every is None:
            return spread(left, [], self.size.width)
        left.append((f"   {count} of {len(every)}", "text"))
        readout = glance.readout
        overtaken = readout.touched > readout.variables_at
        ago = f"read {age(view.now - readout.variables_at)} ago{', lines were sent since' if overtaken else ''} "
        return spread(left, [below, (ago, "strong" if overtaken else "dim")], self.size.width)

    def _row(self, each: Variable, chosen: bool) -> Row:
        left: list[Span] = [
            ("▸ " if chosen else "  ", "accent"),
            (f"{fit(each.name, NAME)} ", "accent" if chosen else "text"),
            (f"{each.value!s:>{VALUE}}  ", "strong" if chosen or each.value else "dim"),
        ]
        return (*left, (fit(each.kept, max(0, self.size.width - NAME - VALUE - 5)), "dim"))

    def _nothing(self) -> str:
        if self._glance is None:
            return "^O chooses a drive"
        return "not read yet: ^P, read again" if self._variables() is None else "no variable has that"

    def _variables(self) -> tuple[Variable, ...] | None:
        return self._glance.readout.variables if self._glance is not None else None

    def _shown(self) -> list[Variable]:
        return narrowed(self._variables() or (), self._words)

    def _by_hand(self) -> ByHand:
        """What the selected drive has. Raises Diagnostic where no drive is selected."""
        if (drive := self.host.session.selected) is None:
            raise Diagnostic("no drive is selected")
        return drive.family.values.by_hand

    # Keys

    def choose(self, at: int) -> None:
        if self.begun is None and self.asked is None:
            self._at = at

    def action_step(self, by: int) -> None:
        if self.begun is None and self.asked is None:
            self._at = min(max(self._at + by, 0), max(0, len(self._shown()) - 1))

    async def action_clicked(self, at: int) -> None:
        """Choose a variable and edit it. A click sends nothing."""
        if self.begun is None and self.asked is None:
            self.choose(at)
            self.action_enter()

    def action_read(self) -> None:
        if self._glance is None:
            self.say("no drive is selected")
        else:
            self.host.outbox.type("/variables")
            self.say(READING, "dim")

    def action_enter(self) -> None:
        """Edit the chosen variable, or send what waits for Enter."""
        if self.begun is not None:
            if (begun := self.accepted()) is not None:
                self._again = begun.kind == EDIT
                self.send(begun.lines)
        elif (each := self._chosen()) is not None:
            numbers = "a number" if each.fraction else "a whole number"
            self.ask_for(EDIT, str(each.value), f"{numbers}; Enter shows the line, Esc changes nothing", each.name)
            self.field.select_all()
            self.say(f"{each.name}: {numbers} from {each.low} to {each.high}", "dim")

    def action_save(self) -> None:
        """Show the line that has the drive keep the chosen variable."""
        each = self._chosen()
        if each is None or self.asked is not None:
            return
        try:
            line = self._by_hand().keep(each)
        except (Diagnostic, Inexpressible) as problem:
            self.say(str(problem))
            return
        if line:
            self.offer(KEEP, (line,))
            self.say(f"Enter sends {line}   Esc: nothing")
        else:
            self.say(f"{each.name} is {each.kept}: no line keeps it")

    def action_leave(self) -> None:
        """Leave the field or the line that waits, then the page."""
        if self.asked is not None or self.begun is not None:
            self._close("nothing was sent")
        else:
            super().action_leave()

    # What is typed

    def _chosen(self) -> Variable | None:
        shown = self._shown()
        return shown[min(self._at, len(shown) - 1)] if shown else None

    def edited(self, text: str) -> None:
        """Narrow while the words are typed; a line that waits for Enter is dropped."""
        if self.asked is None and text != self._words:
            self._words, self._at = text, 0
            if self.begun is not None:
                self._close("nothing was sent")

    def typed(self, text: str) -> None:
        asked = self.asked
        if asked is None:
            self.action_enter()
            return
        if asked.overtaken(self.host.session):
            self._close("it was not used")
            return
        variable = next((each for each in self._variables() or () if each.name == asked.name), None)
        try:
            if variable is None:
                raise Diagnostic("does not exist any more", asked.name, "^P, read again")
            line = self._by_hand().assign(variable, variable.taken(text))
        except (Diagnostic, Inexpressible) as problem:
            self.say(f"nothing was sent: {problem}")
            return
        self._close("")
        self.offer(EDIT, (line,))
        kept = f" - {variable.kept}" if variable.kept else ""
        self.say(f"Enter sends {line}{kept}   Esc: nothing")

    def _close(self, said: str) -> None:
        self.begun = None
        self.end_asking()
        self.say(said, "strong" if said else "dim")
