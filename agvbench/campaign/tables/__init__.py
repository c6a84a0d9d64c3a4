"""The tables of a campaign: their columns, formats and checks."""
