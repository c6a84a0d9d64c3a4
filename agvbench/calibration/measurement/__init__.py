"""What a drive says of its vehicle: clean frames, the path, axle angles and speed."""
