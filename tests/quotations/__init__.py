"""Quotations: rows and phrases of README and docs, made from the tables under reports/reference that they come from.

    python -m tests.quotations

writes the rows into the pages, below their marks (`<!-- rows: name -->`), and prints the phrases, to be put in by hand.
tests/test_documents.py looks for each of them.
"""

from tests.quotations import agreement, bake, classification, gathering, growth, methods, paper, pictures, views
from tests.quotations.quotation import Quotation

QUOTATIONS = (
    Quotation("README.md", "methods", methods.frames_of_each_method),
    Quotation("docs/methods.md", "methods", methods.methods_in_detail),
    Quotation("docs/methods.md", "methods", methods.moving_cameras),
    Quotation("docs/methods.md", "growth", growth.growth_of_methods),
    Quotation("docs/methods.md", "instruction_sets", methods.other_instruction_sets),
    Quotation("docs/methods.md", "peers", methods.other_tracers),
    Quotation("docs/methods.md", "gather", gathering.counting),
    Quotation("docs/methods.md", "gather", gathering.over_counting),
    Quotation("docs/methods.md", "gather", gathering.counts_of_others),
    Quotation("docs/methods.md", "gather", gathering.solids),
    Quotation("docs/methods.md", "baselines", methods.best_packets),
    Quotation("docs/methods.md", "planner", methods.regret),
    Quotation("docs/methods.md", "threads", methods.two_threads),
    Quotation("docs/methods.md", "surface", methods.surfaces),
    Quotation("docs/methods.md", "classification", classification.own_bvh),
    Quotation("docs/methods.md", "classification", classification.classified_rays),
    Quotation("docs/methods.md", "classification", classification.memory_of_shafts),
    Quotation("docs/methods.md", "classification", classification.packets_from_lists),
    Quotation("docs/methods.md", "classification", classification.eyes_that_move),
    Quotation("docs/methods.md", "views", views.twenty_views),
    Quotation("docs/methods.md", "views", views.million_rays),
    Quotation("docs/methods.md", "frame", pictures.whole_pictures),
    Quotation("docs/methods.md", "stereo", methods.two_eyes),
    Quotation("docs/methods.md", "paper", paper.instances),
    Quotation("docs/paper.md", "paper", paper.measured_points),
    Quotation("docs/paper.md", "paper", paper.best_gains),
    Quotation("docs/paper.md", "paper", paper.verdicts),
    Quotation("docs/paper.md", "gather", gathering.gains_where_every_hit_is_wanted),
    Quotation("docs/paper.md", "gather", gathering.verdicts_where_every_hit_is_wanted),
    Quotation("docs/lightmaps.md", "bake", bake.means_of_a_bake),
    Quotation("docs/lightmaps.md", "bake", bake.verdicts_on_lightmaps),
    Quotation("docs/lightmaps.md", "bake_denoise", bake.finished_maps),
    Quotation("docs/lightmaps.md", "bake_denoise", bake.verdicts_on_finishing),
    Quotation("docs/lightmaps.md", "bake_buffers", bake.verdicts_on_buffers),
    Quotation("docs/lightmaps.md", "bake_mitsuba", bake.paths_beside_mitsuba),
    Quotation("docs/lightmaps.md", "bake_mitsuba", bake.verdicts_on_mitsuba),
    Quotation("docs/lightmaps.md", "bake_mitsuba_zen5", bake.paths_beside_mitsuba_before),
    Quotation("docs/lightmaps.md", "bake_adaptive", bake.bias_of_adaptive),
    Quotation("docs/lightmaps.md", "bake_culling_map", bake.verdicts_on_views),
    Quotation("docs/lightmaps.md", "bake_rays", bake.verdicts_on_alignment),
    Quotation("docs/trust.md", "agreement", agreement.by_kind),
    Quotation("docs/trust.md", "agreement", agreement.in_all),
    Quotation("docs/trust.md", "agreement_raster", agreement.of_the_rasteriser),
)
