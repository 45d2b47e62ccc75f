"""Which figures a table gives, each from the grids it is made of, and writing them to files."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import matplotlib
import pandas as pd
from matplotlib import figure as mpl

from atra.files import write_atomically
from experiments.results.table import rows_of
from experiments.workloads.agreement.figures import draw_agreement_figure
from experiments.workloads.build.figures import draw_build_figure
from experiments.workloads.frame.grid_figure import draw_grid_figure
from experiments.workloads.frame.methods_figure import draw_methods_figure
from experiments.workloads.frame.peers_figure import draw_peers_figure
from experiments.workloads.frame.price_figure import draw_price_figure
from experiments.workloads.frame.split_figure import draw_split_figure
from experiments.workloads.frame.threads_figure import draw_threads_figure
from experiments.workloads.memory.figures import draw_memory_figure
from experiments.workloads.memory.instancing_figure import draw_instancing_figure
from experiments.workloads.multiframe.figures import draw_multiframe_figure
from experiments.workloads.multiframe.stereo_figure import draw_stereo_figure
from experiments.workloads.picture.figures import draw_scenes_figure
from experiments.workloads.picture.pictures import ScenePictures
from experiments.workloads.planner.figures import draw_planner_figure

Draw = Callable[[pd.DataFrame], mpl.Figure]


@dataclass(frozen=True)
class FigureKind:
    """name: of the files. caption: what it shows, the paper's number first where it has the figure.

    grids: whose points it draws. per_packet_width: packets of another width are another figure.
    """

    name: str
    caption: str
    grids: tuple[str, ...]
    draw: Draw
    per_packet_width: bool = False


@dataclass(frozen=True)
class DrawnFigure:
    """A figure as the contents of its files.

    grids: whose points it shows. packet_width: only those of this width, None = all.
    """

    name: str
    caption: str
    png: bytes
    svg: bytes
    grids: tuple[str, ...]
    packet_width: int | None = None


_METHODS = ("methods_pixel", "methods_aligned", "methods_visible_first", "methods_tiles")
_AGREEMENT = tuple(
    f"agreement_{kind}{method}"
    for kind in ("", "odd_", "axis_", "needles_")
    for method in ("aligned", "culling_off", "instanced", "visible_first", "tiles", "pixel")
)

FIGURES = (
    FigureKind(
        "figure4", "Figure 4: time per frame over the splits of both axes, culling on", ("grid",), draw_grid_figure,
        True,
    ),
    FigureKind(
        "figure5", "Figure 5: time per frame over horizontal splits, culling off and on", ("horizontal",),
        draw_split_figure, True,
    ),
    FigureKind(
        "figure5_vertical", "As figure 5, over vertical splits", ("vertical",),
        partial(draw_split_figure, axis_name="split_y"), True,
    ),
    FigureKind(
        "figure6", "Figure 6: plan and BVH build over horizontal splits, culling on", ("build",), draw_build_figure
    ),
    FigureKind(
        "figure7", "Figure 7: memory over horizontal splits, culling on", ("memory", "memory_pixel"), draw_memory_figure
    ),
    FigureKind(
        "figure7_instancing", "Beside figure 7: instances instead of copies, in memory and in time",
        ("memory", "memory_instanced", "memory_pixel", "instanced", "copied"), draw_instancing_figure,
    ),
    FigureKind("methods", "Time per frame of every method at its fastest split", _METHODS, draw_methods_figure),
    FigureKind("price", "What a view costs in all, from frame 1 to frame 1,000", _METHODS, draw_price_figure),
    FigureKind(
        "threads", "Speed-up over one thread", ("threads_pixel", "threads_aligned", "threads_visible_first"),
        draw_threads_figure,
    ),
    FigureKind(
        "agreement", "Who is wrong, by float64, where a method and single rays per pixel differ", _AGREEMENT,
        draw_agreement_figure,
    ),
    FigureKind(
        "peers", "Rays per second beside other ray tracers", ("peers_pixel", "peers_own", "peers_others"),
        draw_peers_figure,
    ),
    FigureKind("stereo", "Time of the images of both eyes, together and eye by eye", ("stereo",), draw_stereo_figure),
    FigureKind(
        "multiframe", "Time per frame and memory over the number of frames, together and frame by frame",
        ("multiframe", "multiframe_turn", "multiframe_memory"), draw_multiframe_figure,
    ),
    FigureKind(
        "planner", "Regret of plans: time over the best candidate's", ("planner", "planner_small", "planner_wide"),
        draw_planner_figure,
    ),
)  # fmt: skip


def draw_figures(table: pd.DataFrame, pictures: Sequence[ScenePictures]) -> Iterator[DrawnFigure]:
    """Every figure that the table's grids and the pictures allow, in the paper's order.

    A figure none of whose points was measured is left out: its points are in the table with their reasons.
    """
    if pictures:
        caption = "Figure 3: the scenes, shaded from aligned hits and from single rays per pixel, and their difference"
        yield _as_files("figure3", caption, draw_scenes_figure(pictures), ("scenes",))
    for kind in FIGURES:
        rows = rows_of(table, *kind.grids)
        for name, caption, width, part in _parts(kind, rows):
            if (part["status"] == "ok").any():
                yield _as_files(name, caption, kind.draw(part), kind.grids, width)


def _parts(kind: FigureKind, rows: pd.DataFrame) -> Iterator[tuple[str, str, int | None, pd.DataFrame]]:
    widths = sorted(int(width) for width in rows["packet_width"].dropna().unique())
    if not kind.per_packet_width or len(widths) < 2:
        yield kind.name, kind.caption, None, rows
        return
    for width in widths:
        rays = "single rays" if width == 1 else f"packets of {width}"
        name, caption = f"{kind.name}_{rays.replace(' ', '_')}", f"{kind.caption}; {rays}"
        yield name, caption, width, rows[rows["packet_width"] == width]


def _as_files(
    name: str, caption: str, figure: mpl.Figure, grids: tuple[str, ...], packet_width: int | None = None
) -> DrawnFigure:
    files = {}
    for suffix in ("png", "svg"):
        buffer = io.BytesIO()
        # A fixed salt and no date keep the SVG of equal tables equal.
        with matplotlib.rc_context({"svg.hashsalt": "atra", "svg.fonttype": "path"}):
            if suffix == "svg":  # its dots are those of the pictures in figure 3 alone
                figure.savefig(buffer, format="svg", dpi=72, metadata={"Date": None})
            else:
                figure.savefig(buffer, format="png", dpi=150)
        files[suffix] = buffer.getvalue()
    return DrawnFigure(name, caption, files["png"], files["svg"], grids, packet_width)


def write_figure(folder: Path, figure: DrawnFigure) -> None:
    """`<name>.png` and `<name>.svg` in `folder`."""
    write_atomically(folder / f"{figure.name}.png", figure.png)
    write_atomically(folder / f"{figure.name}.svg", figure.svg)
