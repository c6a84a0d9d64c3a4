"""The firmware in a simulated microcontroller: its process, its time, and its pulses."""
