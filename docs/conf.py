"""How Sphinx builds this documentation: `sphinx-build -W docs docs/_build/html`, with the extra `docs` installed."""

from __future__ import annotations

import sys
from pathlib import Path

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
sys.path[:0] = [str(ROOT), str(DOCS)]

import site_parts  # noqa: E402  after the path is set

project = "atra"
author = "the authors of atra"
release = version = "0.1.0"

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "numpydoc",
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = ["_build", "README.md"]
templates_path = ["_templates"]
suppress_warnings = ["config.cache"]  # the gallery's settings hold functions, which cannot be kept between builds

# Markdown
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3
myst_fence_as_directive = ["mermaid"]

# Docstrings
default_role = "py:obj"  # `name` in a docstring links to the name where there is a page for it
autosummary_generate = True
autodoc_typehints = "none"  # types stand in the docstrings' sections
numpydoc_show_class_members = False  # the template lists them
numpydoc_class_members_toctree = False

# Pages
html_theme = "pydata_sphinx_theme"
html_title = "atra"
html_show_sourcelink = False
html_sidebars = {page: [] for page in ("index", "start", "troubleshooting", "glossary")}  # pages without pages below
html_theme_options = {
    "header_links_before_dropdown": 8,
    "show_prev_next": False,
    "navigation_with_keys": False,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": [],
    "footer_end": [],
}

sphinx_gallery_conf = {
    "examples_dirs": str(ROOT / "examples"),
    "gallery_dirs": "gallery",
    "filename_pattern": r"[/\\]examples[/\\]\w+\.py$",
    "ignore_pattern": r"__init__|parts|city|solids|clusters|external",
    "image_scrapers": (site_parts.written_pictures,),
    "reset_modules": (),
    "reset_argv": site_parts.arguments_of_an_example,
    "remove_config_comments": True,
    "show_memory": False,
    "min_reported_time": 1e9,  # times of a build say nothing about the library
    "download_all_examples": False,
}


def setup(app) -> None:
    site_parts.write_generated_pages(DOCS / "reference")  # before Sphinx looks for pages
    app.connect("source-read", site_parts.link_to_the_repository)
