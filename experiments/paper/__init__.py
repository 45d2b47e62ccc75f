"""The paper: its claims, and its figures of several workloads."""
