"""The MCode language of a simulated drive: lines compiled to closures."""
