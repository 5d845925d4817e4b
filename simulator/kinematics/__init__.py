"""Motion in closed form: profiles, and the segments that they are made of."""
