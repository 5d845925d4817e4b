"""Plots of positions and velocities to rerun."""
