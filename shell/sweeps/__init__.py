"""Sweeps: a program test in many worlds, on all cores or on a cluster; what failed, and the simplest such world."""
