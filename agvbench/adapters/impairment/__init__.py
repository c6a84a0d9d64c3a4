"""Faults to rehearse with: what ``impaired:FAULTS:ADAPTER`` does to a camera or a vehicle, a file for each fault.

Nothing here runs unless an adapter is asked for by that name.
"""
