"""What pages say of rays of one's own, beside other libraries."""

from tests.quotations.quotation import interval, of, span, table_row

_PEERS = {"trimesh": "trimesh with embreex", "open3d": "Open3D"}
_SCENES = ("sponza", "three_holes")
_THREADS = (1, 2)
_QUESTIONS = {
    "closest": "closest hit", "any": "any hit", "count": "number of hits", "all": "all hits", "contains": "inside",
}  # fmt: skip


def rays_beside_others(kept):
    """A question and a kind of rays a row, a scene, a peer and a number of threads a column: the peer's time over
    ours."""
    for question, label in _QUESTIONS.items():
        rows = of(kept.points, grids="rays_questions" if question != "contains" else "rays_contains", question=question)
        batches = sorted(rows["ray_batch"].unique()) if question != "contains" else [None]
        for batch in batches:
            cells = [
                _cell(rows if batch is None else of(rows, ray_batch=batch), scene=scene, method=peer, threads=threads)
                for scene in _SCENES
                for peer in _PEERS
                for threads in _THREADS
            ]
            yield table_row(label if batch is None else f"{label}, {batch}", *cells)


def _cell(rows, **values):
    found = of(rows, **values)
    assert len(found) <= 1, values
    return interval(found.iloc[0], "answer_gain") if len(found) else ""


def hits_lost_by_others(kept):
    """Of all judged hits those lost, by each peer and by us."""
    for peer, name in _PEERS.items():
        rows = of(kept.points, method=peer)
        judged, lost, ours = (f"{rows[column].sum():,}" for column in ("judged_hits", "lost", "library_lost"))
        yield f"of {judged} judged hits {name} lost {lost}, `RayScene` {ours}"


def nanoseconds_a_ray(kept):
    """Rays a row: nanoseconds a ray that the closest hit takes, one thread, coherent and incoherent rays."""
    rows = of(kept.points, grids="rays_numbers")
    for asked, some in rows.groupby("asked"):
        each = {row["ray_batch"]: f"{1e9 * row['answer_library_time_s'] / asked:.0f}" for _, row in some.iterrows()}
        yield table_row(f"{asked:,}", each["coherent"], each["incoherent"])


def rays_in_short(kept):
    """The closest hit over both peers, and all hits, on one thread and on two."""
    for question, words in (("closest", "the closest hit"), ("all", "all hits")):
        rows = of(kept.points, grids="rays_questions", question=question)
        for peer, name in _PEERS.items():
            yield f"{words} {span(of(rows, method=peer)['answer_gain'])} times as fast as {name}"


def inside_in_short(kept):
    rows = of(kept.points, grids="rays_contains")
    yield f"inside {span(rows['answer_gain'])} times"
