"""Drive runs and record them: one run over the bus, and a bench session of many with what it keeps."""
