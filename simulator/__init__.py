"""Simulated drives: cells, wires, families of drives, the floor in virtual time, and its endpoints in real time."""
