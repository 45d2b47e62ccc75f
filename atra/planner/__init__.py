"""The planner: which method, split and build suit a view, measured within a budget of time."""
