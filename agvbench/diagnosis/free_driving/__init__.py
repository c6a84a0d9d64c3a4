"""The pipeline for windows of free driving."""
