"""Run by a Python that has `dvg-devices`: its controller on two stages with its own example programs. Prints JSON."""

import json
import sys
import time

from dvg_devices.MDrive_stepper_protocol_RS422 import MDrive_Controller

WAIT = 120.0
controller = MDrive_Controller()
controller.serial_settings["timeout"] = 2.0  # a busy machine; its own are 0.1 s
facts = {"connected": controller.connect_at_port(sys.argv[1])}
controller.begin("xz")
facts["found"] = [motor.device_name for motor in controller.motors]
x, z = controller.motors


def still(motor, at=None):
    """The position where it stands; `at`: wait until it stands there."""
    end = time.monotonic() + WAIT
    while time.monotonic() < end:
        motor.query_state()
        if not motor.state.is_moving and at in (None, motor.state.position):
            break
    return motor.state.position


facts["variables"] = x.config.user_variables
facts["labels"] = sorted(x.config.user_subroutines)
facts["config"] = [x.config.motion_VM, x.config.IO_S2, x.config.firmware_version]
facts["moved"] = [x.move_relative_mm(1), still(x)]
facts["slews"] = [z.slew_mm_per_sec(2), z.state.is_moving, z.controlled_stop(), still(z) > 0]
facts["refused"] = [x.query("VM 100")[0], x.query_errors(), x.state.has_error, x.state.error]
facts["runs"] = [x.move_relative_mm(30), x.state.is_moving]
controller.STOP()
controller.RESET()
facts["stopped"] = [x.query_state(), x.state.is_moving, z.query_state(), z.state.is_moving]
facts["homed"] = [x.home(), still(x, at=0)]
facts["errors"] = [x.query_errors(), x.state.error]
facts["saved"] = x.save_to_NVM()
controller.close()
print(json.dumps(facts))
