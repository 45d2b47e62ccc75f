"""Quotations: rows and phrases of README and docs, made from the tables under reports/reference that they come from.

    python -m tests.quotations

writes the rows into the pages, below their marks (`<!-- rows: name -->`), and prints the phrases, to be put in by hand.
tests/documents/test_documents.py looks for each of them. reports/reference/tables.md has every table.
"""

from tests.quotations import agreement, bake, classification, gathering, glance, growth, methods, paper, pictures, views
from tests.quotations.quotation import Quotation

_TABLES, _METHODS, _PAPER = "reports/reference/tables.md", "docs/methods.md", "docs/paper.md"
_NOT_HELPFUL, _TRUST = "docs/not_helpful.md", "docs/trust.md"

QUOTATIONS = (
    Quotation("README.md", "methods", methods.frames_of_each_method),
    Quotation(_METHODS, "methods", glance.still_and_moving),
    Quotation(_METHODS, "peers", glance.tracers_of_others),
    Quotation(_METHODS, "gather", glance.counting_in_short),
    Quotation(_METHODS, "frame", glance.pictures_in_short),
    Quotation(_METHODS, "bake", bake.bakes_in_short),
    Quotation(_METHODS, "classification", glance.steps_and_speed),
    Quotation(_METHODS, "paper", glance.instances_in_short),
    Quotation(_METHODS, "growth", glance.growth_in_words),
    Quotation(_METHODS, "instruction_sets", glance.narrower_vectors),
    Quotation(_METHODS, "baselines", glance.tuned_packets),
    Quotation(_METHODS, "threads", glance.second_thread),
    Quotation(_METHODS, "views", glance.views_and_rays),
    Quotation(_METHODS, "stereo", glance.eyes_in_short),
    Quotation(_METHODS, "surface", glance.surfaces_in_short),
    Quotation(_METHODS, "planner", glance.regret_in_short),
    Quotation(_METHODS, "classification", classification.own_bvh),
    Quotation(_METHODS, "bake_mitsuba", glance.mitsuba_in_short),
    Quotation(_METHODS, "bake_mitsuba_zen5", glance.mitsuba_before_in_short),
    Quotation(_METHODS, "bake_rays", glance.sun_in_the_box),
    Quotation(_PAPER, "paper", paper.measured_points),
    Quotation(_PAPER, "paper", paper.best_gains),
    Quotation(_PAPER, "paper", paper.verdicts),
    Quotation(_NOT_HELPFUL, "bake_rays", glance.light_bundles),
    Quotation(_TRUST, "agreement", agreement.by_kind),
    Quotation(_TRUST, "agreement", agreement.in_all),
    Quotation(_TRUST, "agreement_raster", agreement.of_the_rasteriser),
    Quotation(_TABLES, "methods", methods.methods_in_detail),
    Quotation(_TABLES, "methods", methods.moving_cameras),
    Quotation(_TABLES, "robust", methods.price_of_robust),
    Quotation(_TABLES, "growth", growth.growth_of_methods),
    Quotation(_TABLES, "instruction_sets", methods.other_instruction_sets),
    Quotation(_TABLES, "baselines", methods.best_packets),
    Quotation(_TABLES, "peers", methods.other_tracers),
    Quotation(_TABLES, "threads", methods.two_threads),
    Quotation(_TABLES, "views", views.twenty_views),
    Quotation(_TABLES, "views", views.million_rays),
    Quotation(_TABLES, "gather", gathering.counting),
    Quotation(_TABLES, "gather", gathering.over_counting),
    Quotation(_TABLES, "gather", gathering.counts_of_others),
    Quotation(_TABLES, "gather", gathering.solids),
    Quotation(_TABLES, "gather", gathering.gains_where_every_hit_is_wanted),
    Quotation(_TABLES, "gather", gathering.verdicts_where_every_hit_is_wanted),
    Quotation(_TABLES, "paper", paper.instances),
    Quotation(_TABLES, "stereo", methods.two_eyes),
    Quotation(_TABLES, "surface", methods.surfaces),
    Quotation(_TABLES, "planner", methods.regret),
    Quotation(_TABLES, "frame", pictures.whole_pictures),
    Quotation(_TABLES, "classification", classification.classified_rays),
    Quotation(_TABLES, "classification", classification.memory_of_shafts),
    Quotation(_TABLES, "classification", classification.packets_from_lists),
    Quotation(_TABLES, "classification", classification.eyes_that_move),
    Quotation(_TABLES, "bake", bake.means_of_a_bake),
    Quotation(_TABLES, "bake", bake.verdicts_on_lightmaps),
    Quotation(_TABLES, "bake_denoise", bake.finished_maps),
    Quotation(_TABLES, "bake_denoise", bake.verdicts_on_finishing),
    Quotation(_TABLES, "bake_buffers", bake.verdicts_on_buffers),
    Quotation(_TABLES, "bake_mitsuba", bake.paths_beside_mitsuba),
    Quotation(_TABLES, "bake_mitsuba", bake.verdicts_on_mitsuba),
    Quotation(_TABLES, "bake_mitsuba_zen5", bake.paths_beside_mitsuba_before),
    Quotation(_TABLES, "bake_adaptive", bake.bias_of_adaptive),
    Quotation(_TABLES, "bake_culling_map", bake.verdicts_on_views),
    Quotation(_TABLES, "bake_rays", bake.verdicts_on_alignment),
)
