"""All of multidrop in simulated time: one process, one thread, one clock, and faults that a seed draws."""
