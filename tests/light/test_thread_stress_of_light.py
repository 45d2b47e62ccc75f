"""Four threads that call one renderer or baker in any order: every picture and map is that of a single thread."""

import threading
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import atra
from atra import light
from atra.light import Baker, Scene
from tests.baked import cube, sheet
from tests.tracing.stress import Expected, any_of, stress
from tests.tracing.test_threads import CAMERAS, LARGE, MESH

MOST = 3
"""Samples of a picture, at most."""

LAMPS = tuple(
    light.Scene(MESH, lights=[light.Sun((x, -1, -0.2), power=power)]) for x, power in ((0.1, 1.0), (0.4, 3.0))
)
RENDERERS = {
    "hybrid": lambda scene, camera, threads: light.HybridRenderer(scene, camera, threads=threads, most_samples=MOST),
    "hybrid of aligned cells": lambda scene, camera, threads: light.HybridRenderer(
        scene, camera, partial(atra.AlignedTracer, split=(16, 1), threads=threads), threads=threads, most_samples=MOST
    ),
    "paths": lambda scene, camera, threads: light.PathRenderer(scene, camera, threads=threads, most_samples=MOST),
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", RENDERERS)
def test_pictures_of_a_renderer_that_threads_update_and_close_are_those_of_one_thread(kind, tmp_path):
    shapes = {(camera.height, camera.width): camera for camera in CAMERAS}

    def find(shape):
        pictures = set()
        for scene in LAMPS:
            with RENDERERS[kind](scene, shapes[shape], threads=1) as one:
                for _ in range(MOST):
                    one.add()
                    pictures.add(one.image.tobytes())
        return pictures

    expected = Expected(find)

    def image(one, random):
        found = one.image
        is_known = found.tobytes() in expected(found.shape[:2])
        assert is_known, "a picture of no scene, camera and number of samples that there were"

    calls = {
        "image": image,
        "add": lambda one, random: one.add(int(random.integers(1, MOST + 1))),
        "stopped": lambda one, random: one.add(1, stop=lambda: one.samples >= 0),
        "camera": lambda one, random: one.look(any_of(CAMERAS, random)),
        "scene": lambda one, random: one.update(scene=any_of(LAMPS, random)),
        "restart": lambda one, random: one.restart(),
        "save": lambda one, random: one.save(tmp_path / f"{threading.get_ident()}.png"),
        "build": lambda one, random: one.build(),
    }
    stress(lambda: RENDERERS[kind](LAMPS[0], LARGE, threads=2), calls, ("closed", "no sample"))


BOX = cube(inwards=True)
ATLAS = sheet(BOX, 8)
BAKES = tuple(Scene.plain(BOX, 0.6, lights=[light.PointLight((0.3, 0.4, 0.1), power=power)]) for power in (1.0, 0.25))
INSIDE = atra.Camera((0, 0, 0), (1, 0.2, 0.1), width=32, height=32)
VIEWS = (INSIDE, replace(INSIDE, target=(0, 0.1, 1), width=8, height=8), None)


def make_baker(scene=BAKES[0], threads=2):
    return Baker(scene, ATLAS, threads=threads)


def map_of(scene, samples):
    with make_baker(BAKES[scene], 1) as one:
        if samples:
            one.add(samples)
        return one.maps


def is_of(scene, found, expected):
    """Whether each texel has the light that its number of samples gives in this scene."""
    numbers = np.unique(found.samples).tolist()
    same = [(found.combined == expected(scene, samples).combined).all(axis=1) for samples in numbers]
    return all(light[found.samples == samples].all() for light, samples in zip(same, numbers, strict=True))


@pytest.mark.slow
def test_maps_of_a_baker_that_threads_update_and_close_are_those_of_one_thread():
    expected = Expected(map_of)

    def maps(one, random):
        found = one.maps
        assert any(is_of(scene, found, expected) for scene in range(len(BAKES)))

    def stopped(one, random):
        counts = iter(range(3))
        one.add(1, stop=lambda: next(counts, None) is None)

    def probes(one, random):
        assert len(one.probes([(0.1, 0.2, 0.3)], 64).points) == 1

    calls = {
        "maps": maps,
        "add": lambda one, random: one.add(int(random.integers(1, 3))),
        "advance": lambda one, random: one.advance(5),
        "update": lambda one, random: one.update(any_of(BAKES, random)),
        "view": lambda one, random: one.look(any_of(VIEWS, random)),
        "stopped": stopped,
        "probes": probes,
        "share": lambda one, random: one.share_done(5),
        "build": lambda one, random: one.build(),
    }
    stress(make_baker, calls)
