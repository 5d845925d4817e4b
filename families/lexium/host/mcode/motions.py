"""How the motions of an MCode drive begin and end: what is read of them in prints."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from multidrop.base.errors import DriveError
from multidrop.dialects.codec import Procedure
from multidrop.families.lexium.host.classify import INTEGER
from multidrop.families.lexium.host.mcode import exchange
from multidrop.families.lexium.host.mcode.before_request import before_request, value_of
from multidrop.families.lexium.host.mcode.operations import MCodeOperations
from multidrop.families.lexium.host.mcode.settings import listed
from multidrop.families.lexium.host.mcode.state import MCodeState, refuse_in_program
from multidrop.families.lexium.host.motions import FLAGS, GO, POINTS, LexiumMotions, starts_program
from multidrop.families.lexium.manual import parameters
from multidrop.families.lexium.manual.mnemonic import EVERY
from multidrop.families.lexium.manual.table import lookup


def known_words(product: str, words: Sequence[str]) -> list[str]:
    """Those of the words that a product has; of an unknown product, those that every Lexium has."""
    rows = [(word, lookup(word, product if product in EVERY else "")) for word in words]
    every = EVERY - frozenset(personality for personality in EVERY if not personality.startswith("LM"))
    return [
        word
        for word, row in rows
        if row is not None and (product in row.products if product in EVERY else every <= row.products)
    ]


class MCodeMotions(LexiumMotions):
    """How the motions of an MCode drive begin and end."""

    state: MCodeState

    def read(self, words: Sequence[str]) -> Procedure[Mapping[str, int]]:
        """Print values in one line."""
        state = self.state
        refuse_in_program(state, "ask again")
        yield from before_request(state, exchange.question(state, "EF", "[01]"))  # an expected drive shows its product
        asked = known_words(state.product, words)
        if not asked:
            return {}
        items = "".join(f"{word}," if word in FLAGS else f'{word}," ",' for word in asked[:-1]) + asked[-1]
        form = "".join("([01])" if word in FLAGS else f"({INTEGER}) " for word in asked).rstrip()
        printed = re.fullmatch(form, (yield from value_of(state, items, re.sub(r"[()]", "", form))))
        assert printed is not None
        readings = dict(zip(asked, map(int, printed.groups()), strict=True))
        if "BY" in readings and "EF" in readings:
            state.program_read(error=bool(readings["EF"]), running=bool(readings["BY"]))
        return readings

    def error(self) -> Procedure[int | None]:
        return exchange.read_error(self.state)

    def handles_errors(self) -> Procedure[bool]:
        """Look for OE in the stored program, unless it is locked: the refusal would run that very routine (5.1.75)."""
        locked = yield from self.read(("LK",))
        if locked.get("LK"):
            return False
        try:
            lines = yield from MCodeOperations(self.state).perform("L")
        except DriveError:
            return False
        return any(re.search(r"(?<![\w\"])OE\b", line, re.I) for line in lines)

    def program_input(self) -> Procedure[bool]:
        """Read the set-ups of the inputs: a list, or on an MDrivePlus the words S1 to S4."""
        state = self.state
        if "IS" in parameters.lists(state.product, state.version):
            return starts_program((yield from listed(state, "PR IS")))
        for word in known_words(state.product, POINTS):
            printed = yield from value_of(state, word, parameters.SettingForm.FIELDS.value)
            if printed.partition(",")[0].strip() == str(GO):
                return True
        return False

    def carried(self, text: str) -> None:
        self.state.codec.encode(self.state.codec.request(self.state.address, text))
