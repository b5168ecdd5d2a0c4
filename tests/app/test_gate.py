"""Who may enter, whose files are whose, how much may come in."""

from __future__ import annotations

import pytest

pytest.importorskip("nicegui", reason="NiceGUI is not installed; `pip install 'dbvfiv[app]'` brings it")

from fastapi.testclient import TestClient
from starlette.websockets import WebSocketDisconnect

from dbvfiv.app.server import BODY, USER, Site, build, serve
from dbvfiv.errors import CaseError

TOKEN, PASSWORD = "right", "open sesame"


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
    guest.cookies.set("dbvfiv_token", "wrong")
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
    client.cookies.set("dbvfiv_token", TOKEN)
    client.cookies.set(USER, user_cookie)
    assert client.get("/").status_code == 403
    assert not (site.folder / "x").exists()


def test_large_bodies_are_refused(user):
    assert user.post("/files/x", content=b"x", headers={"content-length": str(1 << 30)}).status_code == 413
    told = 0

    def chunks():
        nonlocal told
        for _ in range(64):
            told += 1 << 20
            yield b"x" * (1 << 20)

    answered = user.post("/_nicegui/client/00000000/upload/1", content=chunks())
    assert answered.status_code in (404, 405, 413)
    assert told > BODY or answered.status_code != 200


def test_a_password_lets_in_and_nothing_else(site, monkeypatch):
    monkeypatch.setattr("dbvfiv.app.server.PENALTY", 0.0)
    from dbvfiv.app.server import Guard

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
