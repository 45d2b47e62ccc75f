"""Table, statistics, claims and the terminal."""
