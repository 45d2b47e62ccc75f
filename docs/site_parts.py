"""The parts of the documentation's build that are this project's own: generated pages, examples, links."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import Any

from sphinx_gallery.scrapers import figure_rst

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
PICTURES = DOCS / "_build" / "pictures"
"""What examples write: a folder for each."""

PUBLIC_NAMES = {
    "meshes": (
        "Meshes and files",
        "atra",
        "Mesh load_mesh load_face_sources FaceSources",
    ),
    "cameras": (
        "Cameras and lenses",
        "atra",
        "Camera CalibratedCamera OrthographicCamera LensCamera ImagePlane OpenCVLens FisheyeLens FovLens "
        "EquirectangularLens orbit read_colmap read_transforms read_bop read_calibration cameras_from_trimesh",
    ),
    "images": (
        "Images: the nearest hit of every pixel",
        "atra",
        "trace RasterTracer PixelTracer AlignedTracer VisibleFirstTracer Tracer Hits VisibleTriangles MISS "
        "sub_pixel_offsets render_views FramesTracer Frames Alignment Split",
    ),
    "all_hits": (
        "All hits of every pixel",
        "atra",
        "Count Thickness Transmittance Layers CountResult ThicknessResult TransmittanceResult LayersResult",
    ),
    "rays": (
        "Rays of one's own",
        "atra",
        "RayScene Rays RayHits RayHitLists RayLayers visible_points face_counts FaceCounts",
    ),
    "comparing": (
        "Comparing images",
        "atra",
        "compare Agreement Verdict judge_image ForeignImage ForeignJudgement Convention",
    ),
    "methods": ("A method of one's own", "atra", "Method Prepared"),
    "errors": ("Errors", "atra", "AtraError InputError StorageError MemoryBudgetError EmbreeError ClosedError"),
    "scenes": (
        "Light: scenes, materials and lights",
        "atra.light",
        "Scene ScenePart load_scene Lambertian Metal Dielectric Emissive MetallicRoughness Checker Image "
        "PointLight SpotLight SphereLight Sun GradientSky PanoramaSky constant_sky",
    ),
    "pictures": (
        "Light: pictures",
        "atra.light",
        "PathRenderer HybridRenderer Renderer Progress accumulate relative_error toned stops_of",
    ),
    "lightmaps": (
        "Light: lightmaps",
        "atra.light",
        "Baker Atlas atlas_of Texels Lightmap LightProbes Seams denoised dilated clay_view lit_view save_maps "
        "save_model save_lit_model",
    ),
}
"""Pages of the reference: title, package and its public names, by task."""

_ARGUMENTS = {
    "alignment_drawing": "",
    "all_hits": "--width 240 --height 200",
    "bake": "--samples 16 --size 128 --width 320 --height 320",
    "calibrated_views": "--scene atrium --width 320 --height 240 --views 4",
    "first_image": "",
    "frames": "--scene atrium --width 256 --height 192 --frames 4",
    "interiors": "--samples 8 --width 320 --height 180 --noisy",
    "lenses": "--scene living_room --width 320 --height 240",
    "progressive": "--scene atrium --width 256 --height 192",
    "radiograph": "--width 320 --height 240",
    "shadow_map": "--scene material_ball --width 320 --height 240",
    "sky_view": "--rays 64 --face 4",
    "stereo": "--scene atrium --width 320 --height 240",
    "sun_hours": "--face 4 --step 30",
    "transparency": "--width 320 --height 240",
    "voxels": "--cells 48 --width 320 --height 240",
    "weekend": "--samples 4 --width 320 --height 180",
}
"""Options of each example when the site is built, small enough for all of them to take a minute or two."""


def arguments_of_an_example(_settings: Any, variables: dict[str, Any]) -> list[str]:
    """The command line an example gets: its size, and the folder for its pictures."""
    name = Path(variables["src_file"]).stem
    return [*_ARGUMENTS[name].split(), "--out", str(PICTURES / name)]


def written_pictures(_block: Any, variables: dict[str, Any], settings: dict[str, Any]) -> str:
    """Take the PNG files that an example wrote into its page."""
    names = []
    for picture in sorted((PICTURES / Path(variables["src_file"]).stem).glob("*.png")):
        path = next(variables["image_path_iterator"])
        shutil.move(picture, path)
        names.append(path)
    return figure_rst(names, settings["src_dir"])


def write_generated_pages(folder: Path) -> None:
    """Write the reference: a page for each task, and the harness's options and columns."""
    from experiments.reference import command_line, configuration_keys, table_columns

    pages = {name: _names_page(title, package, names.split()) for name, (title, package, names) in PUBLIC_NAMES.items()}
    pages["command_line"] = command_line()
    pages["options"] = configuration_keys()
    pages["columns"] = table_columns()
    tables = (ROOT / "reports" / "reference" / "tables.md").read_text(encoding="utf-8")
    pages["tables"] = re.sub(r"\[([^\]]+)\]\(([^.#)][^)]*)\)", r"\1 (`reports/reference/\2`)", tables)
    folder.mkdir(exist_ok=True)
    for name, text in pages.items():
        if text.startswith("##"):
            text = re.sub(r"^##", "#", text, flags=re.M)
        path = folder / f"{name}.md"
        if not path.exists() or path.read_text(encoding="utf-8") != text:  # an unchanged page is not built again
            path.write_text(text, encoding="utf-8")


def _names_page(title: str, package: str, names: list[str]) -> str:
    listed = "".join(f"   {package}.{name}\n" for name in names)
    return f"## {title}\n\n```{{eval-rst}}\n.. autosummary::\n   :toctree: api\n\n{listed}```\n"


def link_to_the_repository(_app: Any, document: str, source: list[str]) -> None:
    """Files outside of `docs` have no page here: name them in place of a link that would lead nowhere."""
    text = source[0]
    text = re.sub(r"\]\((\.\./)+reports/reference/tables\.md", "](reference/tables.md", text)
    text = re.sub(r"\[([^\]]+)\]\(\.\./([^)]+)\)", _named, text)
    text = text.replace("```mermaid", "```text")
    source[0] = re.sub(r"\(\.\./\.\./docs/", "(../", text)


def _named(link: re.Match[str]) -> str:
    return f"{link[1]} (`{link[2]}`)"
