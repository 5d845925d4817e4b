"""Lexium MDrive, Lexium Motion Module and MDrivePlus: MCode on a serial line or TCP, and Modbus/TCP."""
