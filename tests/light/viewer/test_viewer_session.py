"""The viewer's session without page, thread or renderer: what is drawn when, by a clock that the tests move."""

import random
import threading
from dataclasses import fields, replace

import numpy as np
import pytest

from atra.errors import InputError
from atra.light.viewer.request import COLUMNS, SHADES, SPLITS, Pose, Request, Settings
from atra.light.viewer.session import GROWTH, LEAST_GAP_S, REST_S, Picture, Session

WAVES = 8
FIRST = Request(Pose((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), 45.0), Settings(samples=5))

OTHER = {
    "frame": "path", "shade": "occlusion", "samples": 9, "side": 256, "method": "aligned", "split_x": 4,
    "jitter": "off", "shadow_rays": 2, "shadow_length": 1.5, "sun_cone": 1.0,
    "sun_heading": 10.0, "sun_height": 20.0, "sun_power": 2.0, "sun_colour": (255, 0, 0), "sky_power": 2.0,
    "occlusion_rays": 3, "occlusion_length": 1.0, "occlusion": "cosine", "bounces": 1,
    "exposure": 1.5, "tone": "agx", "denoise": True,
}  # fmt: skip
"""Another value of every parameter."""

KEPT = {"samples", "exposure", "tone", "denoise"}
KEEP_SAMPLES = {"hybrid": KEPT | {"shade", "sun_power", "sun_colour", "sky_power"}, "path": KEPT}
"""What costs no sample: light is in those of paths, and another shade is hybrid rendering's."""


def at(x):
    return replace(FIRST.pose, eye=(x, 0.0, 0.0))


class Clock:
    """Moves when it is told to, and does what is due on the way."""

    def __init__(self):
        self.now_s = 0.0
        self.due = []

    def __call__(self):
        return self.now_s

    def pass_(self, seconds):
        end_s = self.now_s + seconds
        while self.due and self.due[0][0] <= end_s:
            self.now_s, act = self.due.pop(0)
            act()
        self.now_s = end_s


class Artist:
    """Draws wave after wave, which takes time, into one film; a sample that is stopped is taken back.

    The picture holds, wave by wave, the camera and the samples that were drawn."""

    def __init__(self, clock, wave_s=0.004):
        self.clock, self.wave_s = clock, wave_s
        self.film = np.zeros((WAVES, 1, 3))
        self.drawn = None
        self.added = 0
        self.sketched = []
        self.stopped = 0

    def sketch(self, request):
        self.sketched.append(request)
        film = np.zeros((WAVES, 1, 3))
        for wave in range(WAVES):
            self.clock.pass_(self.wave_s)
            film[wave] = request.pose.eye[0], request.settings.sun_power, 0
        return Picture(film, {})

    def add(self, request, stop):
        if self.drawn is None or not request.keeps_samples_of(self.drawn):
            self.film[:] = 0.0
        self.drawn = request
        whole = self.film.copy()
        for wave in range(WAVES):
            if stop():
                self.film = whole
                self.stopped += 1
                return self.samples
            self.clock.pass_(self.wave_s)
            self.film[wave, :, 0] = request.pose.eye[0]
            self.film[wave, :, 2] += 1
        self.added += 1
        return self.samples

    @property
    def samples(self):
        return int(self.film[0, 0, 2])

    def show(self, request):
        assert self.drawn is not None, "there is nothing whole to be shown"
        self.film[:, :, 1] = request.settings.sun_power
        return Picture(self.film.copy(), {})


class Screen:
    def __init__(self, clock):
        self.clock = clock
        self.frames = []
        self.told = []

    def show(self, frame):
        self.frames.append((self.clock(), frame))

    def tell(self, problem):
        self.told.append(problem)


def made(first=FIRST):
    clock = Clock()
    artist, screen = Artist(clock), Screen(clock)
    return Session(artist, screen, first, clock), artist, screen, clock


def run(session, clock):
    """Until there is nothing more to do and nothing more will be asked for."""
    while True:
        pauses_s = [] if (pause_s := session.step()) is None else [pause_s]
        pauses_s += [clock.due[0][0] - clock.now_s] if clock.due else []
        if not pauses_s:
            return
        clock.pass_(min(pauses_s))


def test_no_frame_of_1000_random_camera_moves_is_torn_and_the_newest_wins():
    session, artist, screen, clock = made()
    chosen, asked, when_s = random.Random(1), [FIRST], 0.0

    def move(number):
        def act():
            if chosen.random() < 0.2:
                session.want(**chosen.choice([{"sun_power": float(number)}, {"samples": 3 + number % 5}]))
            else:
                session.want(at(float(number)))
            asked.append(session.wanted)

        return act

    for number in range(1, 1001):
        when_s += chosen.choice([0.0, 0.001, 0.01, 0.05, 0.2, 0.4, 0.8])
        clock.due.append((when_s, move(number)))
    run(session, clock)

    order = {id(request): place for place, request in enumerate(asked)}
    places = [order[id(frame.request)] for _, frame in screen.frames]
    assert places == sorted(places), "an older request was shown after a newer one"
    for _, frame in screen.frames:
        expected = frame.request.pose.eye[0], frame.request.settings.sun_power, frame.samples
        assert (frame.picture.image == expected).all(), "a frame of two cameras, parameters or samples"
    last = screen.frames[-1][1]
    assert (last.request, last.samples) == (session.wanted, session.wanted.settings.samples)
    assert artist.stopped > 20
    assert sum(frame.samples > 1 for _, frame in screen.frames) > 20
    assert len(artist.sketched) < 900, "cameras that were overtaken were drawn"


def test_samples_wait_until_the_camera_has_rested():
    session, _, screen, clock = made()
    clock.due = [(0.1 * number, lambda number=number: session.want(at(number))) for number in range(1, 6)]
    run(session, clock)
    moving = [when_s for when_s, frame in screen.frames if not frame.samples]
    still = [when_s for when_s, frame in screen.frames if frame.samples]
    assert len(moving) == 6
    assert still[0] == pytest.approx(0.5 + REST_S + WAVES * 0.004)


def test_nothing_is_drawn_before_it_is_asked_for():
    session, _, screen, _ = made()
    asking = threading.Timer(0.1, session.want, (at(1.0),))
    asking.start()
    keep = screen.show

    def show(frame):
        keep(frame)
        session.close()

    screen.show = show
    session.run()
    assert screen.frames[0][1].request.pose == at(1.0)


def test_a_wave_is_the_last_when_the_camera_moves_and_other_light_stops_no_sample():
    session, artist, screen, clock = made()
    clock.due = [(REST_S + 2.5 * artist.wave_s, lambda: session.want(sun_power=3.0))]
    run(session, clock)
    assert (artist.stopped, artist.added, len(artist.sketched)) == (0, 5, 1)
    assert screen.frames[-1][1].picture.image[0, 0, 1] == 3.0
    session, artist, screen, clock = made()
    clock.due = [(REST_S + 2.5 * artist.wave_s, lambda: session.want(at(1.0)))]
    run(session, clock)
    assert artist.stopped == 1
    assert screen.frames[1][0] == pytest.approx(REST_S + (3 + WAVES) * artist.wave_s)  # three waves and a sketch


def test_a_camera_that_goes_and_comes_back_within_a_wave_finds_no_half_sample(monkeypatch):
    session, artist, screen, clock = made()
    add = artist.add

    def goes_and_comes_back(request, stop):
        if artist.added != 2 or artist.stopped:
            return add(request, stop)
        session.want(at(1.0))
        assert add(request, stop) == 2
        session.want(FIRST.pose)
        clock.pass_(1.0)
        return artist.samples

    monkeypatch.setattr(artist, "add", goes_and_comes_back)
    run(session, clock)
    assert artist.stopped == 1
    assert screen.told == []
    for _, frame in screen.frames:
        assert (frame.picture.image == (0.0, FIRST.settings.sun_power, frame.samples)).all()
    assert screen.frames[-1][1].samples == 5


def test_samples_end_when_there_are_enough_and_more_can_be_asked_for():
    session, artist, screen, clock = made()
    run(session, clock)
    assert artist.added == 5
    session.want(samples=8)
    run(session, clock)
    session.want(samples=2)
    run(session, clock)
    assert (artist.added, len(artist.sketched)) == (8, 1)
    assert screen.frames[-1][1].samples == 8


def test_a_picture_is_sent_less_often_the_longer_it_has_converged():
    session, _, screen, clock = made(replace(FIRST, settings=Settings(samples=1000)))
    run(session, clock)
    times = np.array([when_s for when_s, frame in screen.frames if frame.samples])
    gaps, began_s = np.diff(times)[:-1], REST_S  # the last picture is sent when it is done
    sample_s = WAVES * 0.004
    least = np.maximum(LEAST_GAP_S, GROWTH * (times[:-2] - began_s))
    assert (gaps >= least - 1e-9).all()
    assert (gaps <= least + sample_s + 1e-9).all()
    assert len(times) < 30


@pytest.mark.parametrize("frame", KEEP_SAMPLES)
@pytest.mark.parametrize("field", OTHER)
def test_what_restarts_a_picture(field, frame):
    assert OTHER.keys() == {one.name for one in fields(Settings)}
    session, artist, screen, clock = made(replace(FIRST, settings=replace(FIRST.settings, frame=frame)))
    run(session, clock)
    session.want(**{field: "hybrid" if (field, frame) == ("frame", "path") else OTHER[field]})
    session.step()
    shown = screen.frames[-1][1]
    assert shown.request is session.wanted
    assert (shown.samples, len(artist.sketched)) == ((5, 1) if field in KEEP_SAMPLES[frame] else (0, 2))


def test_asking_for_the_same_again_changes_nothing():
    session, _, screen, clock = made()
    run(session, clock)
    count = len(screen.frames)
    session.want(at(0.0), samples=5)
    assert session.step() is None
    assert len(screen.frames) == count


@pytest.mark.parametrize("shade", SHADES)
def test_what_is_hit_needs_one_sample_and_light_many(shade):
    enough = replace(FIRST.settings, shade=shade).enough
    assert enough == (5 if shade in ("material", "occlusion") else 1)


@pytest.mark.parametrize("broken", ["sketch", "add", "show"])
def test_what_cannot_be_drawn_is_told_once_and_the_next_camera_is_drawn(broken, monkeypatch):
    session, artist, screen, clock = made()

    def refuse(*_):
        raise InputError("too far away")

    with monkeypatch.context() as patched:
        patched.setattr(artist, broken, refuse)
        clock.pass_(1.0)
        while session.step() is not None:
            pass
        assert session.step() is None
    assert screen.told == ["too far away"]
    session.want(at(2.0))
    run(session, clock)
    assert screen.frames[-1][1].samples == 5
    assert screen.frames[-1][1].request.pose == at(2.0)


@pytest.mark.parametrize("aspect", [0.01, 0.5, 1.0, 1.42, 2.0, 100.0])
def test_pictures_have_the_asked_for_pixels_and_widths_that_every_split_divides(aspect):
    camera = replace(FIRST, pose=replace(FIRST.pose, aspect=aspect)).camera
    assert camera.width % COLUMNS == 0
    assert all(camera.width % split == 0 for split in SPLITS)
    assert 0.75 < camera.width * camera.height / 512**2 < 1.3
    if 0.2 <= aspect <= 5.0:
        assert camera.width / camera.height == pytest.approx(aspect, rel=0.01)


@pytest.mark.parametrize(
    ("heading", "height", "travels"), [(0, 0, (0, 0, -1)), (90, 0, (-1, 0, 0)), (5, 90, (0, -1, 0))]
)
def test_the_sun_stands_where_its_angles_say(heading, height, travels):
    settings = Settings(sun_heading=heading, sun_height=height)
    assert settings.sun_direction == pytest.approx(travels, abs=1e-12)
