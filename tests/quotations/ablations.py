"""What the pages quote of sweep=ablations: what each part of our methods is worth."""

from experiments.results.statistics import Estimate, Pool
from experiments.workloads.series import best_rows
from tests.quotations.quotation import SCENES, TIMES, estimate, interval, of, say, table_row

_ALIGNED = {"method": "aligned", "split_x": 128}
_HIDDEN = {"method": "raster", "left_out": "hidden"}
_SCENES_OF_THE_SUN = ("cornell_box", "sponza")


def worth_of_parts(kept):
    """A part a row: speed with it over speed without it, and what is left over packets where that says more."""
    frames = _Frames(kept)
    yield frames.over_packets("culled tiles without alignment", method="tiles")
    yield frames.over_packets(f"visible-first, 1 {TIMES} 1", method="visible_first", split_x=1)
    yield frames.best_over_packets("visible-first, best split", method="visible_first")
    for width in (1, frames.widest):
        one = _ALIGNED | {"packet_width": width, "robust": False}
        yield frames.over_first_cell(f"our reference rays ÷ the first cell's, {_rays(width)}", one)
    fast = _ALIGNED | {"packet_width": frames.widest, "reference": "off_axis"}
    yield frames.ratio("fast ÷ robust, aligned packets", fast | {"robust": False}, fast | {"robust": True})
    yield frames.over_packets("robust packets per pixel", method="pixel", robust=True)
    narrow = {lanes: {"method": "raster", "left_out": "hidden", "lanes": str(lanes)} for lanes in (4, 8)}
    for label, without in (
        ("rasteriser ÷ without occlusion", {"method": "raster", "left_out": "outside"}),
        ("rasteriser ÷ without clusters", {"method": "raster", "left_out": "none"}),
        *((f"rasteriser ÷ with {lanes} lanes", one) for lanes, one in narrow.items()),
    ):
        yield frames.ratio(label, _HIDDEN, without)


def our_reference_rays(kept):
    """A setting a row: speed with our reference rays over speed with those of the first cell."""
    frames = _Frames(kept)
    for culling, split, width in (
        (False, 16, 1),
        *((True, split, width) for split in (16, 128) for width in (1, frames.widest)),
    ):
        label = f"{_rays(width)}, {split} {TIMES} 1{'' if culling else ', culling off'}"
        one = {"method": "aligned", "culling": culling, "split_x": split, "packet_width": width}
        yield frames.over_first_cell(label, one)


def worth_of_the_shortcut(kept):
    """Rays to the sun, aligned: over packets with the shortcut and without it, and the one over the other."""
    rows = of(kept.processes, workload="bake_rays")
    for scene in _SCENES_OF_THE_SUN:
        with_it, without = (
            of(rows, scene=scene, shortcut=how)["packets_over_aligned"].astype(float).tolist() for how in (True, False)
        )
        pool = Pool.of([with_it, without])
        one, other = Estimate.of(with_it, pool), Estimate.of(without, pool)
        yield table_row(f"`{scene}`", say(one), say(other), say(one.over(other)))


class _Frames:
    """Rows of frames, single points by their options."""

    def __init__(self, kept):
        self._points, self._processes = of(kept.points, workload="frame"), of(kept.processes, workload="frame")
        self.widest = int(self._points["packet_width"].max())

    def over_packets(self, label, **values):
        return table_row(label, *(say(self._speed(scene, values)) for scene in SCENES))

    def best_over_packets(self, label, **values):
        found = [best_rows(of(self._points, scene=scene, **values)) for scene in SCENES]
        return table_row(label, *(interval(rows.iloc[0], "speedup_vs_packets") for rows in found))

    def ratio(self, label, one, other):
        return table_row(label, *(say(self._speed(scene, one).over(self._speed(scene, other))) for scene in SCENES))

    def over_first_cell(self, label, values):
        """Speed with our reference rays over speed with those of the first cell."""
        return self.ratio(label, values | {"reference": "off_axis"}, values | {"reference": "first_cell"})

    def _speed(self, scene, values):
        """Over packets in the same rounds. Lanes that are not named are the machine's."""
        rows = of(self._processes, scene=scene, **values)
        if values["method"] == "raster" and "lanes" not in values:
            rows = rows[rows["lanes"].eq("native")]
        assert rows["point_id"].nunique() == 1, (scene, values)
        return estimate(rows, "speedup_vs_packets")


def _rays(width):
    return "single rays" if width == 1 else "packets"


def sun_in_short(kept):
    """Aligned rays to the sun on the Cornell box over coherent packets, with the shortcut and without."""
    row = next(line for line in worth_of_the_shortcut(kept) if "`cornell_box`" in line)
    with_it, without_it = (cell.split()[0] for cell in row.split("|")[2:4])
    yield f"{with_it} with it, {without_it} without it"
