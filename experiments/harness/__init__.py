"""Points, their identity, processes and records: runs any workload and names none."""
