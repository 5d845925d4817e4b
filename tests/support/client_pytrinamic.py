"""Run by a Python that has `pytrinamic`: moves, parameters, search, a refusal, by the maker's client. Prints JSON."""

import json
import sys
import time

from pytrinamic.connections import SerialTmclInterface, SocketTmclInterface
from pytrinamic.modules import TMCM1241
from pytrinamic.tmcl import TMCLReplyStatusError

WAIT = 120.0


def until(done):
    """Wait until something is so."""
    end = time.monotonic() + WAIT
    while not done() and time.monotonic() < end:
        time.sleep(0.02)


place = sys.argv[1]
line = SocketTmclInterface(place) if ":" in place else SerialTmclInterface(place, datarate=9600)
with line as connection:
    motor = TMCM1241(connection).motors[0]
    facts = {"version": connection.get_version_string(), "address": connection.get_global_parameter(66, 0)}
    motor.set_axis_parameter(motor.AP.MaxVelocity, 200_000)
    motor.set_axis_parameter(motor.AP.MaxAcceleration, 1_000_000)
    motor.move_to(51_200)
    until(motor.get_position_reached)
    facts["moved"] = motor.actual_position
    motor.move_by(-1_200)
    until(lambda: motor.actual_position == 50_000)
    facts["moved by"] = motor.actual_position
    motor.rotate(-20_000)
    until(lambda: motor.get_axis_parameter(3, signed=True) == -20_000)
    facts["turns"] = motor.get_axis_parameter(3, signed=True)
    motor.stop()
    until(lambda: not motor.get_axis_parameter(3))
    facts["stopped"] = motor.get_axis_parameter(3)
    motor.set_axis_parameter(194, 200_000)
    connection.reference_search(0, 0)
    until(lambda: not connection.reference_search(2, 0))
    facts["searched"] = motor.actual_position
    try:
        motor.get_axis_parameter(250)
    except TMCLReplyStatusError as refusal:
        facts["refused"] = refusal.status_code
print(json.dumps(facts))
