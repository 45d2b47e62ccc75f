"""The viewer's gate: senseless messages are ignored, other origins refused, and no client takes another's turn."""

import asyncio
import contextlib
import threading
import urllib.error
import urllib.request
from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from atra.light.viewer import page as pages
from atra.light.viewer.page import Page
from atra.light.viewer.session import Picture
from tests.light.viewer.test_viewer_session import FIRST

viser = pytest.importorskip("viser", reason="viser is not installed: pip install -e '.[viewer]'")

import msgspec  # noqa: E402
from websockets.asyncio.server import ServerConnection  # noqa: E402
from websockets.exceptions import ConnectionClosed, InvalidStatus  # noqa: E402
from websockets.sync.client import connect  # noqa: E402

from atra.light.viewer import gate  # noqa: E402
from atra.light.viewer.gate import LARGEST_BYTES, makes_sense  # noqa: E402

PATIENCE_S = 60.0
CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": [1.0, 0.0, 0.0, 0.0], "position": [0, 0, 1.5], "fov": 0.8, "near": 0.01,
    "far": 1000.0, "image_height": 200, "image_width": 300, "look_at": [0.0, 0.0, 0.0], "up_direction": [0.0, 1.0, 0.0],
}  # fmt: skip
HEARD = threading.Condition()
"""Told when the session has been asked for something."""

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
    leave_s, pages.LEAVE_S = pages.LEAVE_S, 1e6  # or it ends between two tests
    one = Page(QuickArtist(), FIRST, 0, "a test", 3.0)
    want = one.session.want

    def heard(*pose, **fields):
        want(*pose, **fields)
        with HEARD:
            HEARD.notify_all()

    one.session.want = heard
    thread = threading.Thread(target=one.session.run)
    thread.start()
    yield one
    assert thread.is_alive(), "a message has ended the viewer"
    one.session.close()
    thread.join(PATIENCE_S)
    one.close()
    pages.LEAVE_S = leave_s


def joined(page, origin="own", host=None):
    address = page.address.replace("http", "ws")
    headers = {} if host is None else {"Host": host}
    client = connect(
        address, subprotocols=[f"viser-v{viser.__version__}"], origin=page.address if origin == "own" else origin,
        additional_headers=headers, max_size=None,
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
    with HEARD:
        assert HEARD.wait_for(lambda: page.session.wanted.settings.side == side, PATIENCE_S)


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


def test_no_control_takes_a_value_that_it_cannot_have_and_the_viewer_goes_on(page):
    before = page.session.wanted
    with joined(page) as client:
        for label, value in BAD:
            assert not makes_sense(sent(update(page, label, value)), page._can_have), (label, value)
            client.send(sent(update(page, label, value)))
        arrives(page, client, 128)
    assert page.session.wanted.settings == type(before.settings)(**{**vars(before.settings), "side": 128}), (
        "one of the others arrived, too"
    )


def test_malformed_messages_are_ignored(page):
    healthy = update(page, "samples", 9)
    malformed = [
        b"", b"\xc1", b"\x91" * 4000, sent([]), sent({}), sent({"type": 1}), sent({"type": "Message"}), sent({1: 2}),
        sent({"type": "ShareUrlRequest"}), sent({**healthy, "more": 1}), sent({**healthy, "uuid": "x"}),
        sent({**healthy, "uuid": [1]}), sent({**healthy, "updates": {"visible": False}}),
        sent({**healthy, "updates": {"update_cb": []}}), sent({**healthy, "updates": [1]}), "text",
    ]  # fmt: skip
    malformed += [sent({**CAMERA, name: value}) for name in CAMERA if name != "type" for value in (None, "x", [], INF)]
    malformed += [sent({**CAMERA, "position": [0, 0, NAN]}), sent({**CAMERA, "wxyz": [0, 0, 0, 0]}),
                  sent({**CAMERA, "image_height": 0}), sent({**CAMERA, "fov": 4.0})]  # fmt: skip
    assert not any(makes_sense(message, page._can_have) for message in malformed)
    assert len(malformed) < gate.MOST_BAD
    with joined(page) as client:
        for message in malformed:
            client.send(message)
        client.send(sent({**CAMERA, "position": [1e12, 0, 0]}))  # makes sense, and cannot be drawn
        arrives(page, client, 192)


SCALARS = st.none() | st.booleans() | st.integers(-(2**63), 2**64 - 1) | st.floats() | st.text(max_size=9)
JSON = st.recursive(
    SCALARS,
    lambda inner: st.lists(inner, max_size=5) | st.dictionaries(st.text(max_size=9), inner, max_size=5), max_leaves=9,
)  # fmt: skip


@settings(deadline=None, max_examples=150)
@given(st.data())
def test_random_json_is_ignored_or_leads_to_settings_that_can_be_drawn(page, data):
    kind = data.draw(st.sampled_from(["any", "camera", "control"]))
    if kind == "any":
        message = data.draw(JSON)
    elif kind == "camera":
        changed = data.draw(st.dictionaries(st.sampled_from(sorted(CAMERA)), JSON, max_size=2))
        message = {**CAMERA, **changed}
    else:
        control = data.draw(st.sampled_from(controls(page)))
        value = data.draw(JSON | st.sampled_from(["hybrid", "path", "normal", "4", (1, 2, 3)]))
        message = {"type": "GuiUpdateMessage", "uuid": control._impl.uuid, "updates": {"value": value}}
    raw = sent(message)
    if not makes_sense(raw, page._can_have):
        return
    assert kind != "any"
    handled = page._server._websock_server._message_class.deserialize(raw)  # what viser makes of it

    async def handle():
        await page._server.gui._handle_gui_updates(0, handled)

    if kind == "control":
        asyncio.run(handle())
    QuickArtist().show(page.session.wanted)


@settings(deadline=None)
@given(st.binary(max_size=200))
def test_random_bytes_never_raise(raw):
    assert not makes_sense(raw, {})


def test_a_message_longer_than_any_of_the_page_ends_its_own_connection_alone(page):
    with joined(page) as bad, joined(page) as good:
        bad.send(bytes(LARGEST_BYTES + 1))
        assert closed(bad) == 1009
        arrives(page, good, 256)


def test_a_connection_is_closed_after_a_hundred_messages_that_make_no_sense(page):
    with joined(page) as bad, joined(page) as good:
        for _ in range(gate.MOST_BAD):
            bad.send(b"x")
        assert closed(bad) == 1008
        arrives(page, good, 320)


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
