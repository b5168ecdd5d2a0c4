"""Server of the page: who may enter, what belongs to whom, how much may come in; NiceGUI draws the page.

The address that is printed holds a token, which becomes a cookie; another cookie names the user, whose folder holds
valves, data files and runs. On an address that others reach a password takes the place of the token.
"""

from __future__ import annotations

import asyncio
import hashlib
import hmac
import re
import secrets
import socket
from collections.abc import Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from http.cookies import CookieError, SimpleCookie
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs

import uvicorn
from fastapi import FastAPI, Request
from fastapi.responses import FileResponse, PlainTextResponse
from nicegui import ui

from ..errors import CaseError
from .page import Page
from .processes import Runs, Workers

#: Names of the cookies of the token, with something of the token, and of the user; the latter is kept for a year, s.
TOKEN, USER, YEAR = "dbvfiv_token", "dbvfiv_user", 365 * 86400
#: Largest body of a request, bytes; time after a wrong password, s.
BODY, PENALTY = 20 << 20, 1.0
#: Kinds of files that are handed out.
SHOWN = {".png", ".gif", ".svg", ".csv", ".html", ".h5", ".toml", ".txt"}
#: What is said of more, before the line is cut.
TOO_LARGE = (f"A file may have {BODY >> 20} MB.", ((b"content-type", b"text/plain"), (b"connection", b"close")))
_LOGIN = """<!doctype html><meta name="viewport" content="width=device-width"><title>dbvfiv</title>
<form method="post" action="/login" style="font: 1.1rem sans-serif; margin: 20vh auto; width: 18rem">
<label>Password <input name="password" type="password" autofocus style="width: 100%"></label><p>{}</p>
<button>Enter</button></form>"""


def is_local(host: str) -> bool:
    """True for an address that only this machine reaches."""
    return host in ("127.0.0.1", "localhost", "::1")


@dataclass
class Guard:
    """Gate before everything that is served: cookies, password, size of what comes in.

    Parameters
    ----------
    app : callable
        ASGI application behind it.
    token : str
    password : str
        Empty where the token in the address is enough.
    """

    app: Callable
    token: str
    password: str = ""

    @property
    def cookie(self) -> str:
        """Name of the cookie of the token: cookies know no ports, and two servers may run on one machine."""
        return f"{TOKEN}_{hashlib.sha256(self.token.encode()).hexdigest()[:8]}"

    async def __call__(self, scope: dict[str, Any], receive: Callable, send: Callable) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        cookies = read_cookies(scope)
        given = cookies.get(self.cookie) or ""
        if hmac.compare_digest(given.encode(), self.token.encode()):
            scope["state"] = scope.get("state") or {}
            scope["state"]["user"] = user = cookies.get(USER, "")
            if re.fullmatch("[0-9a-f]{32}", user):
                await self._bounded(scope, receive, send)
                return
        if scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": 1008})
            return
        await self._enter(scope, receive, send, cookies.get(USER, ""))

    async def _enter(self, scope: dict[str, Any], receive: Callable, send: Callable, user: str) -> None:
        """Let in who has the token or the password, with cookies; refuse others."""
        said = ""
        if self.password and scope["path"] == "/login" and scope["method"] == "POST":
            body = (await read_body(receive, 4096)) or b""
            typed = parse_qs(body.decode("utf-8", "replace")).get("password", [""])[0]
            right = hmac.compare_digest(typed.encode(), self.password.encode())
            if not right:
                await asyncio.sleep(PENALTY)
                said = "That is not the password."
        else:
            asked = parse_qs(scope["query_string"].decode("latin-1")).get("token", [""])[0]
            right = not self.password and hmac.compare_digest(asked.encode(), self.token.encode())
        if right:
            named = user if re.fullmatch("[0-9a-f]{32}", user) else secrets.token_hex(16)
            rest = "Path=/; HttpOnly; SameSite=Lax"
            cookies = (f"{self.cookie}={self.token}; {rest}", f"{USER}={named}; Max-Age={YEAR}; {rest}")
            headers = [(b"location", b"/"), *((b"set-cookie", cookie.encode()) for cookie in cookies)]
            await respond(send, 303, "", headers)
        elif self.password:
            await respond(send, 401, _LOGIN.format(said), [(b"content-type", b"text/html; charset=utf-8")])
        else:
            await respond(send, 403, "Open the address that `dbvfiv app` printed: it holds the token that is missing.")

    async def _bounded(self, scope: dict[str, Any], receive: Callable, send: Callable) -> None:
        """Pass a request on whose body is not too large, by what it says and by what comes."""
        told = dict(scope["headers"]).get(b"content-length", b"0")
        if not told.isdigit() or int(told) > BODY:
            await respond(send, 413, *TOO_LARGE)
            return
        come, begun = 0, False

        async def counted() -> dict[str, Any]:
            nonlocal come
            message = await receive()
            come += len(message.get("body", b"")) if message["type"] == "http.request" else 0
            if come > BODY:
                raise OverflowError
            return message

        async def noted(message: dict[str, Any]) -> None:
            nonlocal begun
            begun = True
            await send(message)

        try:
            await self.app(scope, counted, noted)
        except OverflowError:
            if not begun:
                await respond(send, 413, *TOO_LARGE)


def read_cookies(scope: dict[str, Any]) -> dict[str, str]:
    """Cookies of a request."""
    header = b"; ".join(value for name, value in scope["headers"] if name == b"cookie")
    try:
        return {name: morsel.value for name, morsel in SimpleCookie(header.decode("latin-1")).items()}
    except CookieError:
        return {}


async def read_body(receive: Callable, most: int) -> bytes | None:
    """Body of a request; None where it is larger than that."""
    body = b""
    while True:
        message = await receive()
        body += message.get("body", b"")
        if len(body) > most:
            return None
        if not message.get("more_body"):
            return body


async def respond(send: Callable, status: int, text: str, headers: Any = ((b"content-type", b"text/plain"),)) -> None:
    """Send a short answer."""
    await send({"type": "http.response.start", "status": status, "headers": list(headers)})
    await send({"type": "http.response.body", "body": text.encode()})


@dataclass
class Site:
    """All that the pages share.

    Parameters
    ----------
    folder : Path
        Everything is kept below it.
    start : Path, optional
        Case or result file that every user begins with, once; afterwards with the valve that was left.
    at_once : int
        Runs at a time.
    """

    folder: Path
    start: Path | None = None
    at_once: int = 1
    workers: Workers = field(default_factory=Workers)
    begun: set[Path] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.runs = Runs(self.at_once)
        self.keeping = asyncio.Lock()  # one page at a time looks for a result, and keeps it where it is new

    def home(self, user: str) -> Path:
        """Folder of a user."""
        home = self.folder / "users" / user
        home.mkdir(parents=True, exist_ok=True)
        return home

    def file(self, user: str, name: str) -> Path | None:
        """File of a run of a user by its name below the folder of runs; None where there is none to hand out."""
        runs = (self.home(user) / "runs").resolve()
        try:
            path = (runs / name).resolve()
            inside = path.is_relative_to(runs) and path.is_file() and path.suffix in SHOWN
        except (OSError, ValueError):
            return None
        return path if inside else None


def build(site: Site, token: str, password: str = "") -> FastAPI:
    """Application with the page, the files of runs, and the gate before both."""

    @asynccontextmanager
    async def lifespan(_: FastAPI):
        await site.workers.drawing.start()  # it is ready by the time that a browser has opened the page
        yield
        await site.runs.end()
        site.workers.end()

    app = FastAPI(docs_url=None, redoc_url=None, openapi_url=None, lifespan=lifespan)

    @app.get("/files/{name:path}")
    def file(name: str, request: Request):
        found = site.file(request.state.user, name)
        if found is None:
            return PlainTextResponse("There is no such file.", 404)
        # a report is a page of its own: what runs in it must not speak for the user
        return FileResponse(found, headers={"Content-Security-Policy": "sandbox allow-scripts allow-downloads"})

    @ui.page("/", title="dbvfiv", response_timeout=30)
    async def index(request: Request) -> None:
        await Page(site, site.home(request.state.user)).build()

    ui.run_with(app, title="dbvfiv", tailwind=False, show_welcome_message=False, reconnect_timeout=20.0)
    app.add_middleware(Guard, token=token, password=password)
    return app


def serve(site: Site, host: str = "127.0.0.1", port: int = 0, password: str = "", told: Callable = print) -> None:
    """Serve pages until the process is ended; the address is told once they are there. Raises CaseError for an address
    that cannot be had, or one that others reach without a password.
    """
    if not is_local(host) and len(password) < 8:
        raise CaseError(f"--host {host} is reached by others, so a password of 8 characters at least is needed.")
    token = secrets.token_urlsafe(24)
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
        listener.listen(128)  # who opens the address at once waits
    except OSError as error:
        raise CaseError(f"{host}:{port} cannot be served ({error.strerror}); give another --port.") from None
    site.folder.mkdir(parents=True, exist_ok=True)
    named = f"[{host}]" if ":" in host else host
    address = f"http://{named}:{listener.getsockname()[1]}/" + ("" if password else f"?token={token}")
    server = uvicorn.Server(uvicorn.Config(build(site, token, password), log_level="error", ws_max_size=4 << 20))
    told(f"The valve is at {address}\nCtrl-C ends it; valves and runs are kept in {site.folder}.")
    server.run(sockets=[listener])
