"""Tables, figures, HTML and Rerun recordings."""
