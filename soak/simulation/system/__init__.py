"""In place of the operating system: clock, processes, threads, disk, ports, network, USB, terminal, time of day."""
