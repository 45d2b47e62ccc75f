"""What pages say of rays of one's own, beside other libraries."""

from experiments.results.table import rows_of
from tests.quotations.quotation import digits, of, span, table_row

_PEERS = {"trimesh": "trimesh with embreex", "open3d": "Open3D"}
_SCENES = ("sponza", "three_holes")
_THREADS = (1, 2)
_BATCHES = ("coherent", "incoherent")
_ASKED = ("rays_questions", "rays_questions_threads")
_QUESTIONS = {"closest": "closest hit", "any": "any hit", "all": "all hits"}


def rays_beside_others(kept):
    """A question and a kind of rays a row; a scene and a peer a column: the peer's time over ours, for each number of
    threads that was measured."""
    asked, inside = rows_of(kept.points, *_ASKED), of(kept.points, question="contains")
    for question, label in _QUESTIONS.items():
        for batch in _BATCHES:
            yield table_row(f"{label}, {batch}", *_cells(of(asked, question=question, ray_batch=batch)))
    yield table_row("points inside", *_cells(inside))


def _cells(rows):
    for scene in _SCENES:
        for peer in _PEERS:
            gains = [of(rows, scene=scene, method=peer, threads=threads)["answer_gain"] for threads in _THREADS]
            yield ", ".join(digits(gain.item()) for gain in gains if len(gain))


def hits_lost_by_others(kept):
    """A sentence a peer: how many of the judged hits it lost, and how many `RayScene` lost."""
    for peer, name in _PEERS.items():
        rows = of(kept.points, method=peer)
        judged, lost, ours = (f"{rows[column].sum():,}" for column in ("judged_hits", "lost", "library_lost"))
        yield f"of {judged} judged hits {name} lost {lost}, `RayScene` {ours}"


def nanoseconds_a_ray(kept):
    """A number of rays a row: nanoseconds a ray that the closest hit takes on one thread, coherent and incoherent."""
    for asked, rows in rows_of(kept.points, "rays_numbers").groupby("asked"):
        times = (of(rows, ray_batch=batch)["answer_library_time_s"].item() for batch in _BATCHES)
        yield table_row(f"{asked:,}", *(f"{1e9 * time / asked:.0f}" for time in times))


def rays_in_short(kept):
    """The closest hit, all hits and points inside over both peers, whatever the rays, the scene and the threads."""
    rows = of(kept.points)
    for question, words in (("closest", "the closest hit"), ("all", "all hits")):
        asked = of(rows_of(rows, *_ASKED), question=question)
        gains = (
            f"{span(of(asked, method=peer)['answer_gain'])} times as fast as {name}" for peer, name in _PEERS.items()
        )
        yield f"{words} {' and '.join(gains)}"
    yield f"what lies inside {span(of(rows, question='contains')['answer_gain'])} times"


def closest_hit_over_trimesh(kept):
    rows = of(rows_of(kept.points, *_ASKED), question="closest", method="trimesh")
    yield f"the closest hit {span(rows['answer_gain'])} times as fast as trimesh with embreex"


def rays_with_avx2(kept):
    """Closest hits over trimesh with embreex: a scene a row, coherent and incoherent."""
    for scene in _SCENES:
        rows = of(kept.points, workload="rays", scene=scene)
        yield table_row(f"`{scene}`", *(digits(of(rows, ray_batch=batch)["answer_gain"].item()) for batch in _BATCHES))
