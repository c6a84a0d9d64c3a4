"""Paths of arcs and straights: the shortest ones (Dubins, Reeds–Shepp), and the path back to a start."""
