"""Results to share: a sweep packed into one file, and a page of several such files."""
