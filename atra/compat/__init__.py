"""Stand-ins for classes of other libraries, with their arguments, shapes and defaults; they stand on the whole core."""
