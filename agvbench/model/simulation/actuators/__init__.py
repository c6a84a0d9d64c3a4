"""Servos and drive while one command is in force: their motion in closed form, and its kinks."""
