"""Modbus/TCP as the Lexium Ethernet drives speak it."""
