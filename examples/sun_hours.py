"""Hours of sun
============

Hours of sun on each face of a city model, on one day.

::

    python -m examples.sun_hours --latitude 48 --month 3 --day 21

The sun's way is that of the package pvlib if it is installed, else of a formula that is right to about a degree. A face
has sun while the sun stands before it and nothing is in between. Writes `sun_hours.png`.
"""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from importlib import import_module
from importlib.util import find_spec

import numpy as np
from numpy.typing import NDArray

import atra
from examples import city, parts


def sun_directions(latitude: float, month: int, day: int, step_minutes: float) -> NDArray[np.float64]:
    """(N, 3) float64, unit vectors to the sun at each step of a day while it is up: x east, y north, z up.

    latitude: degrees, at longitude 0.
    """
    midnight = datetime(2025, month, day, tzinfo=UTC)
    times = [midnight + timedelta(minutes=float(minute)) for minute in np.arange(0.0, 1440.0, step_minutes)]
    if find_spec("pvlib"):
        import pandas as pd

        get_solarposition = import_module("pvlib.solarposition").get_solarposition

        found = get_solarposition(pd.DatetimeIndex(times), latitude, 0.0)
        elevation, azimuth = np.deg2rad(found["elevation"].to_numpy()), np.deg2rad(found["azimuth"].to_numpy())
        level = np.cos(elevation)
        ways = np.stack([level * np.sin(azimuth), level * np.cos(azimuth), np.sin(elevation)], axis=1)
    else:
        ways = plain_sun(latitude, midnight.timetuple().tm_yday, np.array([t.hour + t.minute / 60 for t in times]))
    return ways[ways[:, 2] > 0.0]


def plain_sun(latitude: float, day_of_year: int, hours: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 3) float64, unit vectors to the sun at solar hours of a day. Source: P. I. Cooper, "The absorption of
    radiation in solar stills", 1969, for the declination."""
    declination = np.deg2rad(23.45) * np.sin(2 * np.pi * (284 + day_of_year) / 365)
    angle, north = np.deg2rad(15.0) * (hours - 12.0), np.deg2rad(latitude)
    east = -np.cos(declination) * np.sin(angle)
    up = np.sin(north) * np.sin(declination) + np.cos(north) * np.cos(declination) * np.cos(angle)
    ahead = np.cos(north) * np.sin(declination) - np.sin(north) * np.cos(declination) * np.cos(angle)
    return np.stack([east, ahead, up], axis=1)


def sun_hours(mesh: atra.Mesh, suns: NDArray[np.float64], step_hours: float, threads: int = 1) -> NDArray[np.float64]:
    """(F,) float64, hours of sun on each face; suns: from `sun_directions`."""
    origins, normals = city.places(mesh)
    hours = np.zeros(mesh.triangle_count)
    with atra.RayScene(mesh, threads=threads) as scene:
        for sun in suns:
            facing = np.flatnonzero(normals @ sun > 0.0)
            directions = np.broadcast_to(sun, (len(facing), 3))
            hours[facing] += step_hours * ~scene.occluded(origins[facing], directions)
    return hours


def main(arguments: list[str] | None = None) -> NDArray[np.float64]:
    """Hours of sun on each face of the city."""
    made = parts.parser(__doc__, width=960, height=640)
    made.add_argument("--latitude", type=float, default=48.0, help="degrees north")
    made.add_argument("--month", type=int, default=3)
    made.add_argument("--day", type=int, default=21)
    made.add_argument("--step", type=float, default=15.0, help="minutes")
    made.add_argument("--face", type=float, default=2.0, help="size of faces, metres")
    options = made.parse_args(arguments)
    mesh = city.city(size=options.face)
    suns = sun_directions(options.latitude, options.month, options.day, options.step)
    hours = sun_hours(mesh, suns, options.step / 60, options.threads)
    print(f"the sun is up {len(suns) * options.step / 60:.1f} hours; faces have it {hours.mean():.1f} hours on average")
    parts.save(options.out / "sun_hours.png", city.picture(mesh, hours, options.width, options.height))
    return hours


if __name__ == "__main__":
    main()
