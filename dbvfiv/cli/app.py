"""``dbvfiv app``: the valve in the browser."""

from __future__ import annotations

import os
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from ..errors import CaseError


def app(
    file: Annotated[
        Path | None,
        typer.Argument(metavar="[CASE|RESULT.h5]", help="Case file to begin with, or a result, whose case it is."),
    ] = None,
    folder: Annotated[
        Path | None,
        typer.Option("--folder", metavar="DIR", help="Folder of valves and runs; the user's data without it."),
    ] = None,
    host: Annotated[
        str, typer.Option("--host", help="Address to serve; others than this machine reach it only with a password.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option("--port", min=0, max=65535, help="Port; a free one without it.")] = 0,
    runs: Annotated[int, typer.Option("--runs", min=1, max=16, help="Runs at a time; others wait.")] = 1,
    browse: Annotated[bool, typer.Option("--browse", help="Also open the page in a browser.")] = False,
) -> None:
    """The valve in the browser: describe it, ask it with sliders, see curves and maps, run studies and the report.

    dbvfiv app my.toml

    The password for --host is asked for, or taken from DBVFIV_APP_PASSWORD.
    """
    if find_spec("nicegui") is None:
        raise CaseError("The page needs NiceGUI, which is not installed; `pip install 'dbvfiv[app]'` brings it.")
    import platformdirs

    from ..app.server import Site, is_local, serve
    from ..studies.case import load_case

    if file is not None and file.suffix.lower() != ".h5":
        load_case(file)  # a mistake is told before anything is served
    password = ""
    if not is_local(host):
        password = os.environ.get("DBVFIV_APP_PASSWORD") or typer.prompt("Password for the page", hide_input=True)
    home = folder or Path(platformdirs.user_data_dir("dbvfiv")) / "app"

    def tell(text: str) -> None:
        print(text, flush=True)
        if browse:
            typer.launch(text.split()[4])

    serve(Site(home.resolve(), file and file.resolve(), runs), host, port, password, tell)
