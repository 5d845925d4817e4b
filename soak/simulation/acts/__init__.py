"""What can happen in a step of a story; `story` lists all of it."""
