"""What commands print: tables that fit a terminal, summaries and progress."""
