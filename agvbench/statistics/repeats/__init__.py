"""How many repeats: planned before they are driven, or decided while they are."""
