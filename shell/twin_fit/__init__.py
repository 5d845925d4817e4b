"""Load, friction, inertia and current margin of axes, found in a session log."""
