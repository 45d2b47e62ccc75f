"""The HTML report: one page with the figures, claims and pictures of a run, and a table of each workload."""

from __future__ import annotations

from experiments.report.page import ReportContents, write_report

__all__ = ["ReportContents", "write_report"]
