"""Steps over nights: where they are, and whether chance would find them."""
