"""`multidrop share`: a port for several clients, of which one writes."""
