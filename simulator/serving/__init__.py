"""A floor in real time: endpoints on sockets and pseudo-terminals, pipes within the process, `multidrop sim`."""
