"""Everything the thesis measured, refitted and predicted, beside its own figures."""
