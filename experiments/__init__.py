"""The experiments: configuration, points and their workers, tables and figures."""
