"""The simulated Arcus PMX-2ED-SA: two axes, stored programs, an RS-485 port."""
