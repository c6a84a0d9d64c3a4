"""Data of a diagnosis: runs from rest or windows of free driving, checked and split into three sets."""
