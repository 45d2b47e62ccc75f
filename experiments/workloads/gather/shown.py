"""What is shown of gathering all hits."""

from __future__ import annotations

from experiments.workloads.frame_figures import methods_figure, rows_over, split_ratios
from experiments.workloads.gather import GATHER
from experiments.workloads.panels import where_varies, workload_figure

FIGURES = (
    workload_figure(
        "gather", "All hits: speed-up over packets that gather the same", GATHER, methods_figure,
        where_varies("method"),
    ),
    workload_figure(
        "figure5_gather", "As figure 5, where every ray gathers all hits: speed-up over horizontal splits", GATHER,
        split_ratios, rows_over("split_x"), per_packet_width=True,
    ),
)  # fmt: skip
