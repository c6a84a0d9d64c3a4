"""The thesis' measurements refitted (chapters 6 and 7, section 8.1, appendix B), beside its printed figures."""
