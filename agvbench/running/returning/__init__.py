"""The vehicle drives itself back to the start, whatever it is like: closed loop on motion capture.

::

    way back (planning) ─► legs ─► follower ─► command ─► supervisor ─► link
                                      ▲                                   │
                       habits ◄───── sight ◄──────── frames ◄─────────────┘
"""
