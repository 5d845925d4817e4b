"""What a simulated drive remembers: variables, program memory, its error, its time, what it has printed."""
