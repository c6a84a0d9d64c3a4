"""What a diagnosis reads: runs from rest or windows of free driving, checked and split into three sets."""
