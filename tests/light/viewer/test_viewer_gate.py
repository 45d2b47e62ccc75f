"""The viewer's gate: senseless messages are ignored, other origins refused, and no client takes another's turn."""

import asyncio
import contextlib
import urllib.error
import urllib.request
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from atra.light.viewer import page as pages
from atra.light.viewer.session import Picture
from tests.light.viewer.test_viewer_page import PATIENCE_S, running, wait_for
from tests.light.viewer.test_viewer_session import FIRST

viser = pytest.importorskip("viser", reason="viser is not installed: pip install -e '.[viewer]'")

import msgspec  # noqa: E402
from websockets.asyncio.server import ServerConnection  # noqa: E402
from websockets.exceptions import ConnectionClosed, InvalidStatus  # noqa: E402
from websockets.sync.client import connect  # noqa: E402

from atra.light.viewer import gate  # noqa: E402
from atra.light.viewer.gate import LARGEST_BYTES, makes_sense  # noqa: E402

CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": [1.0, 0.0, 0.0, 0.0], "position": [0, 0, 1.5], "fov": 0.8, "near": 0.01,
    "far": 1000.0, "image_height": 200, "image_width": 300, "look_at": [0.0, 0.0, 0.0], "up_direction": [0.0, 1.0, 0.0],
}  # fmt: skip
INF, NAN = float("inf"), float("nan")


class QuickArtist:
    """Draws black, and works out all that a picture depends on."""

    def sketch(self, request):
        return self.show(request)

    def __init__(self):
        self.samples = 0

    def add(self, request, stop):
        self.samples += 1
        return self.samples

    def show(self, request):
        assert request.camera.width > 0
        assert np.isfinite(request.settings.sun_direction).all()
        return Picture(np.zeros((8, 8, 3), np.uint8), {})


@pytest.fixture(scope="module")
def page():
    with pytest.MonkeyPatch.context() as changed, running(QuickArtist(), FIRST) as one:
        changed.setattr(pages, "LEAVE_S", 1e6)  # or it ends between two tests
        yield one
        assert one.thread.is_alive(), "a message has ended the viewer"


def joined(page, origin="own"):
    client = connect(
        page.address.replace("http", "ws"), subprotocols=[f"viser-v{viser.__version__}"],
        origin=page.address if origin == "own" else origin, max_size=None,
    )  # fmt: skip
    client.send(sent(CAMERA))  # viser knows nobody without a camera
    return client


def sent(message):
    return msgspec.msgpack.encode(message)


def update(page, label, value):
    uuid = next(one._impl.uuid for one in controls(page) if one.label == label)
    return {"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": value}}


def controls(page):
    every = page._server.gui._gui_input_handle_from_uuid.values()
    return [one for one in every if one._impl.uuid in page._can_have]


def arrives(page, client, side):
    """A healthy message of this client does what it says."""
    client.send(sent(update(page, "side, pixels", side)))
    wait_for(lambda: page.session.wanted.settings.side == side, "a healthy message")


def closed(client):
    """With which code the server ends the connection."""
    with contextlib.suppress(ConnectionClosed):
        while True:
            client.recv(PATIENCE_S)
    return client.close_code


BAD = [
    ("heading", INF), ("heading", NAN), ("heading", 181.0), ("heading", "x"), ("heading", None), ("heading", [1.0]),
    ("frame", "x"), ("frame", 1), ("frame", ["hybrid"]), ("frame", "x" * 3000), ("shade", {}), ("samples", 0),
    ("samples", 10**9), ("samples", 2.5e300), ("samples", -1), ("side, pixels", 10**6), ("side, pixels", INF),
    ("method", "x"), ("method", []), ("columns", "3"), ("columns", "x"), ("jitter", 1),
    ("denoise at rest", None), ("denoise at rest", 1), ("colour", [1, 2]),
    ("colour", [1, 2, 300]), ("colour", [INF, 0, 0]), ("colour", "red"), ("shadow length", 0), ("bounces", 10**6),
    ("exposure", INF), ("tone map", "x"), ("movement", "fly"), ("save picture", 1),
    ("step", "x"),
]  # fmt: skip


def malformed(page):
    healthy = update(page, "samples", 9)
    yield from (b"", b"\xc1", b"\x91" * 4000, "text")
    yield from map(sent, [
        [], {}, {"type": 1}, {"type": "Message"}, {1: 2}, {"type": "ShareUrlRequest"}, {**healthy, "more": 1},
        {**healthy, "uuid": "x"}, {**healthy, "uuid": [1]}, {**healthy, "updates": {"visible": False}},
        {**healthy, "updates": {"update_cb": []}}, {**healthy, "updates": [1]}, {**CAMERA, "position": [0, 0, NAN]},
        {**CAMERA, "wxyz": [0, 0, 0, 0]}, {**CAMERA, "image_height": 0}, {**CAMERA, "fov": 4.0},
    ])  # fmt: skip
    yield from (sent({**CAMERA, name: value}) for name in CAMERA if name != "type" for value in (None, "x", [], INF))


def test_messages_without_sense_and_values_that_no_control_can_have_are_ignored_and_the_viewer_goes_on(page):
    before = page.session.wanted.settings
    for side, messages in ((128, [sent(update(page, *one)) for one in BAD]), (192, [*malformed(page)])):
        assert not any(makes_sense(message, page._can_have) for message in messages)
        assert len(messages) < gate.MOST_BAD
        with joined(page) as client:
            for message in messages:
                client.send(message)
            client.send(sent({**CAMERA, "position": [1e12, 0, 0]}))  # makes sense, and cannot be drawn
            arrives(page, client, side)
        assert page.session.wanted.settings == replace(before, side=side), "one of the others arrived, too"


SCALARS = st.none() | st.booleans() | st.integers(-(2**63), 2**64 - 1) | st.floats() | st.text(max_size=9)
JSON = st.recursive(
    SCALARS,
    lambda inner: st.lists(inner, max_size=5) | st.dictionaries(st.text(max_size=9), inner, max_size=5), max_leaves=9,
)  # fmt: skip


@settings(deadline=None, max_examples=150)
@given(st.data())
def test_random_messages_are_ignored_or_lead_to_settings_that_can_be_drawn(page, data):
    assert not makes_sense(data.draw(st.binary(max_size=200)), page._can_have)
    assert not makes_sense(sent(data.draw(JSON)), page._can_have)
    changed = data.draw(st.dictionaries(st.sampled_from(sorted(CAMERA)), JSON, max_size=2))
    makes_sense(sent(CAMERA | changed), page._can_have)
    control = data.draw(st.sampled_from(controls(page)))
    value = data.draw(JSON | st.sampled_from(["hybrid", "path", "normal", "4", (1, 2, 3)]))
    raw = sent({"type": "GuiUpdateMessage", "uuid": control._impl.uuid, "updates": {"value": value}})
    if makes_sense(raw, page._can_have):
        handled = page._server._websock_server._message_class.deserialize(raw)  # what viser makes of it
        asyncio.run(page._server.gui._handle_gui_updates(0, handled))
        QuickArtist().show(page.session.wanted)


@pytest.mark.parametrize(("message", "count", "code", "side"), [
    (bytes(LARGEST_BYTES + 1), 1, 1009, 256), (b"x", gate.MOST_BAD, 1008, 320),
], ids=["too long", "too many without sense"])  # fmt: skip
def test_a_client_that_sends_too_much_ends_its_own_connection_alone(page, message, count, code, side):
    with joined(page) as bad, joined(page) as good:
        for _ in range(count):
            bad.send(message)
        assert closed(bad) == code
        arrives(page, good, side)


@pytest.mark.parametrize("origin", [None, "http://evil.example", "null", "http://127.0.0.1:1", "https://{own}"])
def test_a_websocket_of_another_origin_is_refused(page, origin):
    own = page.address.removeprefix("http://")
    with pytest.raises(InvalidStatus, match="403"):
        joined(page, None if origin is None else origin.replace("{own}", own))


@pytest.mark.parametrize(("headers", "status"), [
    ({}, 200), ({"Origin": "own"}, 200), ({"Origin": "http://evil.example"}, 403), ({"Origin": "null"}, 403),
    ({"Host": "evil.example"}, 403), ({"Host": "evil.example:80", "Origin": "http://evil.example:80"}, 403),
    ({"Host": "localhost:8"}, 200), ({"Host": "localhost:8", "Origin": "http://localhost:8"}, 200),
])  # fmt: skip
def test_pages_are_given_to_their_own_origin_alone(page, headers, status):
    """A port that is forwarded, as localhost:8, is an origin of its own."""
    own = {name: page.address if value == "own" else value for name, value in headers.items()}
    try:
        with urllib.request.urlopen(urllib.request.Request(page.address, headers=own), timeout=PATIENCE_S) as answer:
            found = answer.status
    except urllib.error.HTTPError as error:
        found = error.code
    assert found == status


def test_no_more_than_sixteen_pages_are_let_in():
    headers = gate.Headers({"Host": "localhost:1", "Origin": "http://localhost:1", "Upgrade": "websocket"})
    assert gate.refusal(headers, gate.MOST_CLIENTS - 1) is None
    refused = gate.refusal(headers, gate.MOST_CLIENTS)
    assert refused.status_code == 503


def test_however_much_others_send_a_good_client_has_every_turn_that_it_wants(monkeypatch):
    """Messages are counted, not seconds: between two of the good client the bad ones have one each, and few more."""
    taken = Counter()

    async def here_already(self, decode=None):
        taken[self.name] += 1
        return b"good" if self.name == "good" else b"bad"

    monkeypatch.setattr(ServerConnection, "recv", here_already)
    monkeypatch.setattr(gate, "MOST_BAD", 10**9)
    monkeypatch.setattr(gate, "makes_sense", lambda raw, _: raw == b"good")

    def connection(name):
        one = gate.GatedConnection.__new__(gate.GatedConnection)
        one._controls, one._bad, one.name = {}, 0, name
        return one

    async def race():
        others = [asyncio.create_task(connection(f"bad {k}").recv()) for k in range(gate.MOST_CLIENTS - 1)]
        good = connection("good")
        for _ in range(50):
            await good.recv()
        for one in others:
            one.cancel()

    asyncio.run(race())
    assert taken["good"] == 50
    assert all(taken[f"bad {k}"] <= 55 for k in range(gate.MOST_CLIENTS - 1))
