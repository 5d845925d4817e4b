"""Run by a Python that has `pymdrive`: two axes on a line, as its own pages use it. Prints what came of it as JSON."""

import asyncio
import json
import logging
import sys
import warnings

from pymdrive import MdriveAxis, MdriveComm, emergency_stop

warned = []
handler = logging.Handler()
handler.emit = lambda record: warned.append(record.getMessage())
logging.getLogger().addHandler(handler)
warnings.showwarning = lambda message, *_: warned.append(str(message))


async def main() -> None:
    comm = MdriveComm(sys.argv[1])
    await comm.start()
    x, y = MdriveAxis(comm, "X"), MdriveAxis(comm, "Y")
    facts = {}
    x.set_velocity(400000)
    await x.set_acceleration(2000000)
    facts["set"] = [await x.get_velocity(), await x.get_acceleration(), await y.get_velocity()]
    await x.set_position(1000)
    await x.move_absolute(513000)
    facts["moving"] = [await x.is_moving(), await y.is_moving()]
    await x.wait_for_motion_done()
    await x.move_relative(-51200)
    await x.wait_for_motion_done()
    facts["moved"] = await x.get_position()
    await y.home_negative()
    facts["homed"] = [await y.get_position(), await y.is_homed(), await x.is_homed()]
    await x.move_relative(51200000)
    facts["aborted"] = [await x.is_moving()]
    await x.abort_move()
    await x.wait_for_motion_done()
    facts["aborted"] += [await x.get_position() < 5000000]
    await x.move_relative(51200000)
    emergency_stop(comm)
    facts["stopped"] = await x.is_moving()
    x.disable()
    x.enable()
    facts["all"] = await x.read_all_parameters()
    await comm.stop()
    facts["warned"] = warned
    print(json.dumps(facts))


asyncio.run(main())
