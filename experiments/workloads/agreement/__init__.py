"""Who is wrong where a method and single rays differ."""
