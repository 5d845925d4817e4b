"""The ways in to an MCode drive: its line of text, and Modbus/TCP."""
