"""Figures of the manual, each by the command that makes it: python tools/figures.py [--list] [NAME ...]

Without names all are made, which takes hours; a name is that of a file in docs/figures without its ending. Results are
kept in out/figures, so that an interrupted run goes on and a figure whose result is there is only drawn again.
"""

from __future__ import annotations

import argparse
import os
import shlex
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
KEPT, MANUAL = Path("out/figures"), Path("docs/figures")


@dataclass(frozen=True)
class Made:
    """Figures that one command makes.

    Attributes
    ----------
    name : str
        Of its result and of the folder that its figures are drawn into, in out/figures.
    command : str
        Command line; of a study without `-o` and `--plots`, which are added. `{folder}` is the folder.
    figures : dict
        From the file that is made to its name in the manual.
    study : bool
        Whether it is one that keeps a result which is taken up again.
    """

    name: str
    command: str
    figures: dict[str, str]
    study: bool = True


_CYCLE = "dbvfiv transient cases/light-fluid.toml"
ALL = (
    Made(
        "closure",
        "dbvfiv closure cases/closure.toml",
        {"side-views.png": "closure-side-views.png", "contact-map.png": "closure-contact-map.png"},
    ),
    Made("closure-thin", "dbvfiv closure cases/closure-thin.toml", {"closure-curve.png": "closure-thin.png"}),
    Made(
        "cycle",
        "dbvfiv cycle cases/light-fluid.toml --over density=10:60:11",
        {"branch.png": "cycle-branch.png", "wave.png": "cycle-wave.png"},
    ),
    Made(
        "map",
        "dbvfiv map cases/dbv12.toml --x pressure=300:20000:64 --y density=1:1000:64:log --both --set damping.alpha=0",
        {"stability-map.png": "stability-map.png"},
    ),
    *(
        Made(
            f"moulded-{size}",
            f'dbvfiv map cases/dbv{size}-moulded.toml --x "pressure=0.02 m:1 m:14:log" --y sealing=400:2400:8:log '
            "--both --set mesh.around=20 --set mesh.along=36 --set map.curve=false --set map.refine=0 "
            "--set map.checks=2",
            {"stability-map.png": f"moulded-{size}-inch.png"},
        )
        for size in (12, 6)
    ),
    Made(
        "tongue",
        'dbvfiv onset cases/dbv12.toml --over "pressure=0.3 kPa:36 kPa:49:log" --set fluid.density=10 '
        "--set fluid.continuity=storage --set damping.alpha=0",
        {"onset.png": "stability-onset.png"},
    ),
    Made(
        "rubber",
        "dbvfiv map cases/dbv12-default.toml --x pressure=300:36000:40:log --y density=0.5:2000:40:log --both",
        {"stability-map.png": "stability-map-loss-factors.png"},
    ),
    Made(
        "line-length",
        "dbvfiv map cases/dbv12-in-line.toml --set mesh.around=14 --set mesh.along=24 --set upstream.roughness=0 "
        "--set upstream.loss=1.52 --x pressure=0.5e3:40e3:10:log --y pipe_length=0.5:100:16:log --both",
        {"stability-map.png": "in-line-length.png"},
    ),
    Made(
        "line-loss",
        "dbvfiv map cases/dbv12-in-line.toml --set mesh.around=14 --set mesh.along=24 --x pressure=0.5e3:40e3:10:log "
        "--y loss_factor=0.25:3:8:log --both",
        {"stability-map.png": "in-line-loss-factors.png"},
    ),
    Made(
        "kick",
        f'{_CYCLE} --set fluid.density=50 --set transient.step="1 ms" --set transient.duration="3 s"',
        {"history.png": "transient-history.png", "phase-portrait.png": "transient-phase-portrait.png"},
    ),
    Made(
        "settled",
        f'{_CYCLE} --set fluid.density=45 --set transient.kick_opening="6 mm"',
        {
            "centre-line-cycle.png": "transient-cycle-centre-line.png",
            "lip-wave.png": "transient-cycle-wave.png",
            "cycle.gif": "transient-cycle.gif",
        },
    ),
    Made(
        "slam-in-air",
        'dbvfiv transient cases/dbv12.toml --set mesh.around=14 --set mesh.along=24 --set drive.pressure="6 kPa" '
        "--set fluid.density=1.2 --set damping.alpha=0 --set fluid.continuity=storage --set fluid.sound_speed=343 "
        '--set supports.contact=faces --set supports.contact_stiffness="1000 MPa/mm" '
        '--set transient.step="0.1 ms" --set transient.duration="0.8 s"',
        {"history.png": "transient-slamming-in-air.png"},
    ),
    Made(
        "sudden",
        "python cases/studies/sudden_pressure.py {folder}",
        {"sudden-pressure.png": "transient-sudden.png", "sudden-sensitivity.png": "transient-sensitivity.png"},
        study=False,
    ),
    Made(
        "response",
        "python cases/studies/response_to_density.py {folder} 60 57 56 54 52 50 45 40 35 30 25 20 "
        '--step "1 ms" --theory',
        {"response.png": "transient-response.png"},
        study=False,
    ),
    Made(
        "modes",
        'dbvfiv modes cases/dbv12.toml -p "6 kPa" --density 10 --set damping.alpha=0',
        {"eigenvalues.png": "modes-eigenvalues.png", "winding.png": "modes-count.png"},
    ),
    Made("damping", "dbvfiv damping cases/loss-factor.toml --plots {folder}", {"damping.png": "damping.png"}, False),
    Made(
        "report",
        'dbvfiv report cases/dbv36.toml --set drive.pressure="2 m" --set "report.heads=[0.2 m, 0.5 m, 1 m, 2 m]" '
        '--set project.customer="Harbour board" -o {folder}/dbv36.html --pdf',
        {"dbv36.pdf": "report-page.png"},
        study=False,
    ),
    Made(
        "page",
        "python -m tests.app.pictures {folder}",
        {"describe.png": "app-describe.png", "ask.png": "app-ask.png", "see.png": "app-see.png"},
        study=False,
    ),
    Made("valve", "dbvfiv plot cases/dbv4-wide.toml -o {folder}", {"valve.png": "valve-described.png"}, False),
    Made(
        "flow",
        'dbvfiv cfd out/figures/three.h5 --state "36 kPa" --pipe "330 mm" -o {folder} --plots {folder}',
        {"velocity.png": "flow-velocity.png", "pressure.png": "flow-pressure.png", "rows.png": "flow-rows.png"},
        study=False,
    ),
)
#: What a command needs from another one.
BEFORE = {"flow": 'dbvfiv steady cases/dbv12.toml -p "18 kPa" -p "36 kPa" -o out/figures/three.h5'}


def make(one: Made) -> None:
    """Run a command, or go on with its result, and put its figures into the manual."""
    folder, result = KEPT / one.name, KEPT / f"{one.name}.h5"
    folder.mkdir(parents=True, exist_ok=True)
    if one.name in BEFORE:
        _run(BEFORE[one.name])
    if not one.study:
        _run(one.command.format(folder=folder))
    else:
        if result.exists():
            _run(f"dbvfiv resume {result}", accepted=(0, 2))  # 2: nothing is left to do
        else:
            _run(f"{one.command} -o {result}")
        animate = " --animate 1" if "cycle.gif" in one.figures else ""
        _run(f"dbvfiv plot {result} -o {folder}{animate}")
    for made, name in one.figures.items():
        if made.endswith(".pdf"):  # its first page, by the tool of Debian's poppler-utils
            first = ("-f", "1", "-singlefile", "-r", "90", "-png")
            subprocess.run(["pdftoppm", *first, folder / made, (MANUAL / name).with_suffix("")], check=True)
        else:
            shutil.copyfile(folder / made, MANUAL / name)
        print(f"{MANUAL / name}", flush=True)


def _run(line: str, accepted: tuple[int, ...] = (0,)) -> None:
    words = shlex.split(line)
    start = [sys.executable, "-m", "dbvfiv"] if words[0] == "dbvfiv" else [sys.executable]
    print(f"$ {line}", flush=True)
    status = subprocess.run([*start, *words[1:]]).returncode
    if status not in accepted:
        raise SystemExit(f"`{line}` ended with status {status}.")


def main() -> None:
    """Make the figures that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--list", action="store_true", help="only say which command makes which figure")
    given = parser.parse_args()
    os.chdir(ROOT)
    makers = {Path(name).stem: one for one in ALL for name in one.figures.values()}
    unknown = [name for name in given.names if name not in makers]
    if unknown:
        parser.error(f"no figure is called {', '.join(unknown)}; there are {', '.join(sorted(makers))}")
    chosen = {makers[name].name: makers[name] for name in given.names or makers}.values()
    for one in chosen:
        if given.list:
            print(f"{', '.join(one.figures.values())}\n    {one.command.format(folder=KEPT / one.name)}")
        else:
            make(one)


if __name__ == "__main__":
    main()
