"""A wire with drives on it: pacing, collisions, faults, wrong baud rates."""
