"""Random conversations with simulated drives: whatever is typed, the host tells the truth of what came of it."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import DriveError
from multidrop.dialects import Priority
from multidrop.families.lexium.host.mcode.family import MCodeFamily
from multidrop.simulator.cell.spec import Faults
from tests.conftest import Bench
from tests.support.examples import examples
from tests.support.mcode_drives import Desk

pytestmark = pytest.mark.slow

LINES = st.sampled_from(
    [
        *["R1={n}"] * 5,
        *("VM={m}", "ZZ={n}", "PR R1", "PR R1", 'PR "<",R1,">"', "L", "PR UV", "S", "R2={n}", "E", "H 10"),
        *("EM={e}", "em {e}", "Em{e}", "EM=R4", "CK={c}", "ES={e}", 'DN="{d}"', "PY={b}", "IP"),
        *("PG 1", "pg1", "PG=5", "PG", "pg ", "PG"),
        *("PR", "=", "?", ">", "MR", "PG 99999999", "EM=9", "motion", "restart"),
    ]
)
STEPS = st.lists(
    st.tuples(LINES, st.integers(0, 3), st.integers(0, 2), st.sampled_from("defP19"), st.integers(0, 2)), max_size=14
)
CALM, SLOW = Faults(delay=(0.0, 0.02)), Faults(delay=(0.0, 1.6))
NOISY = Faults(flip=3e-3, drop=2e-3, delay=(0.0, 0.02))
CAVEATS = ("or that came by itself", "error it may be", "may have been", "not known", "was executed")


class Trial:
    """One random conversation, and everything that must hold of each of its lines."""

    def __init__(self, desk, faults, alone):
        self.desk, self.alone, self.restarted = desk, alone, False
        self.noisy = faults.flip > 0 or faults.drop > 0

    def step(self, number, line, e, c, d, who):
        who %= len(self.desk.knowns)
        text = line.format(n=number * 1000 + 7 * e + c, m=number, e=e, c=c, d=d, b=c % 2)
        if not self.alone and text[:2] in ("DN", "PY"):
            return
        if text == "restart":
            self.restarted = True
            self.desk.restart(who)
            return
        state, witness, began = self.desk.knowns[who], self.desk.witnesses[who], self.desk.bench.now
        stored, before = state.programming, len(witness.lines)
        error, printed = "", ()
        try:
            if text == "motion":
                self.desk.bench.run(MCodeFamily(state).motion(Priority.POLL), state)
            else:
                printed = self.desk.type(text, who)
        except DriveError as failure:
            error = str(failure)
        assert self.desk.bench.now - began < 120
        new = [each for each in witness.lines[before:] if each[0] == text.strip() and not each[2]]
        self.judge(text, error, printed, stored, [each for each in new if not each[1]], who)

    def judge(self, text, error, printed, stored, ran, who):
        state, device = self.desk.knowns[who], self.desk.devices[who]
        sure = not self.noisy or (state.codec.checksum and state.codec.em != 2)
        if text.startswith("R1="):
            assert len(ran) <= 1, "executed twice"
            if error and sure:
                told = not any(caveat in error for caveat in CAVEATS)
                assert not (ran and told), f"executed, but: {error}"
                unsent = "was not sent" in error.replace("was not sent again", "") or "was not executed" in error
                assert not (ran and unsent), f"executed, but: {error}"
            elif not error and not stored and sure:
                assert len(ran) == 1, "done, but not executed"
        if not error and not stored and sure and text.startswith(("VM=", "ZZ=")):
            raise AssertionError("a refusal was not seen")
        if text == "PR R1" and not error and not stored and (state.codec.checksum or not self.noisy):
            assert printed == (str(device.memory.values["R1"]),)
        if not error and sure and not (state.settings_unknown or state.reply_pending or self.restarted):
            assert self.desk.agrees(who), (
                state,
                device.memory.echo_mode,
                device.memory.checksum,
                device.memory.escape_mode,
            )


@examples(20, nightly=200)
@given(
    st.tuples(st.integers(0, 3), st.integers(0, 2)),
    st.booleans(),
    st.sampled_from([0, 9600]),
    st.sampled_from([CALM, SLOW, NOISY]),
    st.integers(0, 10**6),
    STEPS,
)
def test_whatever_is_typed_to_one_drive_the_host_tells_the_truth(mode, party, baud, faults, seed, steps):
    trial = Trial(Desk(Bench, mode, party=party, baud=baud, faults=faults, seed=seed), faults, True)
    for number, step in enumerate(steps, 1):
        trial.step(number, *step)


@examples(20, nightly=200)
@given(
    st.lists(st.tuples(st.integers(0, 3), st.integers(0, 2)), min_size=3, max_size=3),
    st.sampled_from([0, 9600]),
    st.sampled_from([CALM, SLOW, NOISY]),
    st.integers(0, 10**6),
    STEPS,
)
def test_whatever_is_typed_to_three_drives_none_gets_anothers_answer(modes, baud, faults, seed, steps):
    desk = Desk(Bench, *modes, party=True, baud=baud, faults=faults, seed=seed)
    for device, value in zip(desk.devices, (1001, 2002, 3003), strict=True):
        device.execute(f"R1={value}", desk.bench.now)
    trial = Trial(desk, faults, False)
    for number, step in enumerate(steps, 1):
        trial.step(number, *step)
