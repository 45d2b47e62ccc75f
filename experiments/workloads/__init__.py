"""What is measured at a point, one folder each."""
