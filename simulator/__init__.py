"""The drives that are not there: cell, wire, devices, ports, motion, interpreter, servers, in-process pipes."""
