"""Plain data: what a seed draws of its machine, and what happens in its life."""
