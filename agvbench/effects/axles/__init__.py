"""Effects of the axles: wheelbase, wheels' diameters, and how the axles share speed and steering."""
