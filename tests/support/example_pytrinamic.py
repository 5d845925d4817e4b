"""Run by a Python that has `pytrinamic`: one of the maker's examples, unchanged, on a TCP port of the simulator.

Arguments: the example, the port, how many times faster its pauses pass. It has no person, no screen and no CAN adapter:
Enter is pressed at once, plots are not drawn, and every connection is the TCP one.
"""

import builtins
import runpy
import sys
import time
from pathlib import Path
from unittest.mock import MagicMock

import pytrinamic
from pytrinamic.connections import ConnectionManager

example, place, speed = sys.argv[1:]
begun, sleep = ConnectionManager.__init__, time.sleep


def connect(self, *_, **__):
    """Make the manager of the one connection that there is."""
    begun(self, ["--interface", "socket_serial_tmcl", "--port", place])


ConnectionManager.__init__ = connect
time.sleep = lambda seconds: sleep(seconds / float(speed))
builtins.input = lambda *_: ""
sys.modules["matplotlib"] = sys.modules["matplotlib.pyplot"] = plots = MagicMock()
plots.pyplot, plots.subplots.return_value = plots, (MagicMock(), MagicMock())
folder = Path(pytrinamic.__file__).parent.parent / "examples" / "modules"
runpy.run_path(str(folder / example), run_name="__main__")
print("the example has ended")
