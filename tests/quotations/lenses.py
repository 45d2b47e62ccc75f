"""What docs/cameras.md says of the table of `python -m experiments.studies lens_speed`, one thread."""

import pandas as pd

from tests.quotations.quotation import SCENES, digits, span


def through_lenses(kept):
    """Packets with a lens over packets without; packets over the rasteriser, with a lens; both over the scenes and two
    lenses. A BOP frame over llvmpipe's."""
    one_thread = kept.points[kept.points["threads"] == 1]
    ms = one_thread.groupby(["frame", "method", "lens"], dropna=False)["ms"].median()

    def over(one, other):
        return [pd.Series(ms[scene, one] / ms[scene, other]) for scene in SCENES]

    yield f"packets take {span(pd.concat(over('packets', 'packets without lens')))} times as long through a lens"
    gains = ", ".join(digits(gain.min()) for gain in over("packets", "raster"))
    yield f"at least {gains} times as fast as packets"
    bop = ms["bop"]
    yield f"{digits(float(bop['llvmpipe'].iloc[0] / bop['atra'].iloc[0]))} times as fast as OpenGL on llvmpipe"
