"""Numbers of README and docs, made from the tables under reports/reference that they come from; `writing` says how."""

from experiments.documents import (
    agreement,
    alignment,
    bake,
    classification,
    glance,
    law,
    methods,
    paper,
    pictures,
    rays,
)
from experiments.documents.quotation import Quotation

QUOTED = {
    "README.md": {
        "methods": [methods.frames_in_short],
        "rays": [rays.closest_hit_over_trimesh],
    },
    "docs/methods.md": {
        "methods": [glance.still_and_moving],
        "frame": [glance.pictures_in_short],
        "classification": [classification.own_bvh],
        "paper": [glance.instances_in_short],
        "growth": [glance.growth_in_words],
        "instruction_sets": [glance.narrower_vectors],
        "baselines": [glance.tuned_packets],
        "peers": [glance.others_in_short],
        "threads": [glance.second_thread],
        "views": [glance.twenty_views_in_short],
        "stereo": [glance.eyes_in_short],
        "multiframe": [glance.frames_in_short],
        "surface": [glance.surfaces_in_short],
        "bake_mitsuba": [glance.mitsuba_in_short],
    },
    "docs/rays.md": {"rays": [rays.rays_in_short]},
    "docs/cameras.md": {"lenses": [pictures.through_lenses]},
    "docs/paper.md": {
        "methods": [alignment.where_alignment_stands],
        "paper": [paper.measured_points, paper.best_gains],
        "cornell_candidates": [paper.candidates_in_short],
        "ablations": [alignment.sun_in_short],
        "law": [law.seven_and_a_half],
    },
    "docs/model.md": {"law": [law.errors_in_short, law.choices_in_short, law.rest_of_the_law]},
    "docs/not_helpful.md": {"light_bundles": [glance.light_bundles]},
    "docs/trust.md": {
        "agreement": [agreement.by_kind, agreement.in_all],
        "agreement_raster": [agreement.of_the_rasteriser],
    },
    "reports/reference/tables.md": {
        "methods": [
            methods.frames_of_each_method, methods.methods_in_detail, methods.moving_cameras, methods.price_of_robust,
        ],
        "methods_families": [methods.families],
        "growth": [methods.growth_of_methods, methods.holes_at_edges],
        "instruction_sets": [methods.other_instruction_sets, methods.frames_with_avx2, rays.rays_with_avx2],
        "baselines": [methods.best_packets],
        "peers": [methods.other_tracers, methods.what_was_called],
        "ablations": [alignment.worth_of_parts, alignment.worth_of_the_shortcut],
        "cornell_candidates": [paper.candidates_for_the_gain],
        "older_embree": [paper.an_older_embree],
        "threads": [methods.two_threads],
        "paired": [methods.this_and_before, methods.small_triangles_before],
        "views": [methods.twenty_views, methods.million_rays],
        "rays": [rays.rays_beside_others, rays.hits_lost_by_others, rays.nanoseconds_a_ray],
        "rays_avx2": [rays.rays_in_short],
        "gather": [
            rays.counting, rays.over_counting, rays.counts_of_others, rays.solids,
            rays.gains_where_every_hit_is_wanted, rays.verdicts_where_every_hit_is_wanted,
        ],
        "law": [law.errors_of_methods, law.choices_of_methods, law.where_alignment_pays, law.best_axes],
        "law_tiles": [law.rays_of_tiles],
        "paper": [paper.instances, paper.verdicts],
        "stereo": [methods.two_eyes],
        "multiframe": [methods.several_frames],
        "reference_rays": [alignment.our_reference_rays],
        "surface": [methods.surfaces],
        "frame": [pictures.whole_pictures],
        "equal_error": [pictures.equal_error],
        "equal_error_blocks": [pictures.converged_blocks],
        "classification": [
            classification.classified_rays, classification.memory_of_shafts, classification.packets_from_lists,
            classification.eyes_that_move, classification.verdicts_on_shafts,
        ],
        "paths": [classification.rays_of_paths],
        "bake": [bake.means_of_a_bake, bake.verdicts_on_lightmaps],
        "bake_denoise": [bake.finished_maps, bake.verdicts_on_finishing],
        "bake_buffers": [bake.verdicts_on_buffers],
        "bake_mitsuba": [bake.paths_beside_mitsuba, bake.verdicts_on_mitsuba],
        "bake_adaptive": [bake.bias_of_adaptive],
        "bake_culling_map": [bake.verdicts_on_views],
        "bake_rays": [bake.verdicts_on_alignment],
    },
}  # fmt: skip
"""Page -> sweep -> what the page quotes of its tables."""

QUOTATIONS = tuple(
    Quotation(page, sweep, make) for page, sweeps in QUOTED.items() for sweep, every in sweeps.items() for make in every
)
