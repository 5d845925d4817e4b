"""Arcus PMX-2ED-SA: lines of ASCII with a device number in front, over RS-485 or without a number through a gateway."""
