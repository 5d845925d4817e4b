"""Run by a Python that has pylablib: its Arcus 2EX/2ED stage on a pty or a gateway (HOST:PORT). Prints JSON."""

import json
import sys

from pylablib.devices import Arcus

target = sys.argv[1]
host, _, port = target.rpartition(":")
connection = (host, int(port)) if port.isdigit() else (target, 9600)
stage = Arcus.Performax2EXStage(idx=0, conn=connection)
facts = {"number": stage.get_device_number(), "baudrate": stage.get_baudrate(), "enabled": stage.is_enabled()}
facts["limit errors"] = stage.limit_errors_enabled()
stage.set_global_speed(5000)
stage.set_axis_speed("X", 8000)
facts["low speed"] = stage.query("LSPD=1000")
facts["speeds"] = [stage.get_global_speed(), *stage.get_axis_speed()]
for axis in "XY":
    stage.set_position_reference(axis, 0)
stage.move_to("X", 2000)
facts["moving"] = stage.is_moving("X")
stage.move_by("Y", -1000)
stage.wait_move("all", timeout=30)
facts["position"] = stage.get_position()
stage.jog("X", "+")
stage.stop("X")
stage.wait_move("X", timeout=30)
facts["stopped"] = [stage.is_moving(), stage.get_current_axis_speed()]
stage.enable_limit_errors(True)
stage.jog("Y", "+")
stage.wait_move("Y", timeout=30)
facts["limit"] = [stage.check_limit_error(), stage.get_status("Y")]
stage.clear_limit_error("Y")
facts["cleared"] = stage.check_limit_error("Y")
facts["homing"] = stage.query("HLX-")  # its own home() sends the direction as a word (1.4.3)
stage.wait_move("X", timeout=30)
facts["home"] = stage.get_position("X")
stage.set_digital_output(3, True)
facts["outputs"] = [stage.get_digital_output_register(), stage.get_digital_input_register()]
facts["analog"] = stage.get_analog_input(1)
facts["unknown"] = stage.query("HS")
stage.stop(immediate=True)
stage.close()
print(json.dumps(facts))
