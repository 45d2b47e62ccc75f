"""Time of a frame, beside single rays and packets."""
