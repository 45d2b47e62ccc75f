"""Panels, axes, series and bars; knows no method and no workload."""
