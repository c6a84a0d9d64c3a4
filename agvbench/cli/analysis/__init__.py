"""Read, analyse and compare what was driven."""
