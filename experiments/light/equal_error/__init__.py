"""Time to equal error of path tracing, ours and Mitsuba 3's: measuring, the table, and its figure."""
