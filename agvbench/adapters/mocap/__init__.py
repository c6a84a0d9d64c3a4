"""Mocap adapters: one file each."""
