"""The vehicle drives itself back to the start, whatever it is like: closed loop on motion capture.

::

    return path (planning) ─► legs ─► path following ─► command mapping ─► supervisor ─► link
                                            ▲                                              │
                   online adaptation ◄── motion interface ◄────────── frames ◄─────────────┘
"""
