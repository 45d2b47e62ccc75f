"""Several frames from one set of rays."""
