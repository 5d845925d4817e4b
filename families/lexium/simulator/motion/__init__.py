"""The motor of a simulated drive with its inputs, outputs, limits and trips."""
