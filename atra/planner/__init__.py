"""Which method, split and build suit a view: estimated from what it shows, or measured within a budget of time."""
