"""Chapter 8 predicted from the thesis' own calibration, beside its measured end poses."""
