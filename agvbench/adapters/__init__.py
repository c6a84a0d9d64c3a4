"""What stands between the bus and a vehicle or a motion capture system."""
