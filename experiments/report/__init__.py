"""The HTML report: one self-contained page with the figures, claims, pictures and the whole table of a run."""

from __future__ import annotations

from experiments.report.contents import ReportContents, ReportFigure, ScenePictures
from experiments.report.page import write_report

__all__ = ["ReportContents", "ReportFigure", "ScenePictures", "write_report"]
