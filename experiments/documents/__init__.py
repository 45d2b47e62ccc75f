"""Numbers of README and documents, made from the tables under reports/reference; `writing` says how."""
