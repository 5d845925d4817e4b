"""Twins: simulated drives that run beside real ones, and every difference between the two."""
