"""How much plans lose against the best of all candidates."""
