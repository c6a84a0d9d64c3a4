"""The history of campaigns: trends of every metric, steps with their nights, and what changed there."""
