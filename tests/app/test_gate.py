"""Who may enter, whose files are whose, how much may come in."""

from __future__ import annotations

import asyncio

import pytest

pytest.importorskip("nicegui", reason="NiceGUI is not installed; `pip install 'dbvfiv[app]'` brings it")

from fastapi.testclient import TestClient
from starlette.websockets import WebSocketDisconnect

from dbvfiv.app.server import BODY, USER, Guard, Site, build, respond, serve
from dbvfiv.errors import CaseError

TOKEN, PASSWORD = "right", "open sesame"
COOKIE = Guard(None, TOKEN).cookie


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    return Site(tmp_path_factory.mktemp("site"))


@pytest.fixture(scope="module")
def app(site):
    return build(site, TOKEN)


@pytest.fixture
def guest(app):
    """A browser that has been nowhere."""
    return TestClient(app, "http://127.0.0.1", follow_redirects=False)


@pytest.fixture
def user(guest):
    """A browser that came by the address that was printed."""
    assert guest.get("/?token=right").status_code == 303
    return guest


def test_without_the_token_nothing_is_served(guest):
    for path in (
        "/",
        "/?token=wrong",
        "/?token=",
        "/files/x/result.h5",
        "/_nicegui/3.18.0/static/nicegui.js",
        "/login",
    ):
        assert guest.get(path).status_code == 403, path
    guest.cookies.set(COOKIE, "wrong")
    assert guest.get("/").status_code == 403
    with pytest.raises(WebSocketDisconnect), guest.websocket_connect("/_nicegui_ws/socket.io/?transport=websocket"):
        pass


def test_the_token_becomes_cookies(user):
    assert len(user.cookies[USER]) == 32
    assert user.get("/files/a/result.h5").status_code == 404  # beyond the gate


def test_users_do_not_reach_each_other(app, site):
    one, other = (TestClient(app, "http://127.0.0.1", follow_redirects=False) for _ in range(2))
    for client in (one, other):
        client.get("/?token=right")
    run = site.home(one.cookies[USER]) / "runs" / "a"
    run.mkdir(parents=True)
    (run / "report.html").write_text("mine")
    (run / "run.json").write_text("{}")
    found = one.get("/files/a/report.html")
    assert found.text == "mine" and "sandbox" in found.headers["content-security-policy"]
    assert other.get("/files/a/report.html").status_code == 404
    assert one.get("/files/a/run.json").status_code == 404  # nothing to look at
    name = one.cookies[USER]
    for path in (
        f"../../{name}/runs/a/report.html",
        f"..%2f..%2f{name}%2fruns%2fa%2freport.html",
        f"%2e%2e/%2e%2e/{name}/runs/a/report.html",
        "/etc/passwd",
        "%2fetc%2fpasswd",
        "..%5c..%5cvalve.toml",
        "a%00.html",
    ):
        assert other.get(f"/files/{path}").status_code in (403, 404), path


@pytest.mark.parametrize("user_cookie", ["", "../../x", "0" * 31, "G" * 32])
def test_a_user_is_never_a_path(app, site, user_cookie):
    client = TestClient(app, "http://127.0.0.1", follow_redirects=False)
    client.cookies.set(COOKIE, TOKEN)
    client.cookies.set(USER, user_cookie)
    assert client.get("/files/a/result.h5").status_code == 403
    client.cookies.set(USER, "0" * 32)
    assert client.get("/files/a/result.h5").status_code == 404  # beyond the gate
    assert not (site.folder / "x").exists()


def test_large_bodies_are_refused(user):
    assert user.post("/files/x", content=b"x", headers={"content-length": str(1 << 30)}).status_code == 413


@pytest.mark.parametrize("pieces, status", [(BODY >> 20, 200), ((BODY >> 20) + 9, 413)])
def test_a_body_that_does_not_say_its_length_is_read_to_the_bound(pieces, status):
    read, sent = [], []

    async def inside(scope, receive, send):
        while (message := await receive())["more_body"]:
            read.append(len(message["body"]))
        await respond(send, 200, "")

    async def post():
        messages = iter([*[{"body": b"x" * (1 << 20), "more_body": True}] * pieces, {"body": b"", "more_body": False}])

        async def receive():
            return {"type": "http.request"} | next(messages)

        async def send(message):
            sent.append(message)

        cookies = f"{COOKIE}={TOKEN}; {USER}={'0' * 32}".encode()
        scope = {"type": "http", "method": "POST", "path": "/x", "query_string": b"", "headers": [(b"cookie", cookies)]}
        await Guard(inside, TOKEN)(scope, receive, send)

    asyncio.run(post())
    assert sent[0]["status"] == status and sum(read) == BODY


def test_a_password_lets_in_and_nothing_else(site, monkeypatch):
    monkeypatch.setattr("dbvfiv.app.server.PENALTY", 0.0)

    async def inside(scope, receive, send):
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": scope["state"]["user"].encode()})

    client = TestClient(Guard(inside, TOKEN, PASSWORD), "http://127.0.0.1", follow_redirects=False)
    assert client.get("/?token=right").status_code == 401  # the token of the address is no way in
    assert client.post("/login", data={"password": "wrong"}).status_code == 401
    assert client.post("/login", content=b"password=" + b"x" * 10_000).status_code == 401
    assert client.post("/login", data={"password": PASSWORD}).status_code == 303
    assert client.get("/").text == client.cookies[USER]


def test_others_are_served_with_a_password_only(site):
    with pytest.raises(CaseError, match="password of 8 characters"):
        serve(site, "0.0.0.0", password="short")
