"""Exit statuses, one-sentence failures, and JSON that is alone on standard output."""

import json
import os
import re
import subprocess
import sys
import tomllib
import types

import pytest
import typer

from dbvfiv.cli import main, run
from dbvfiv.cli.main import build
from dbvfiv.cli.studies import _report
from dbvfiv.cli.terminal import print_json
from dbvfiv.errors import CaseError, SolveError
from dbvfiv.studies.case import Case, load_case
from dbvfiv.studies.session import Session
from tests.pages import ROOT


def test_help_lists_every_command(command_line):
    outcome = command_line("--help")
    assert outcome.status == 0
    for name in build().commands:
        assert f"\n  {name} " in outcome.out


def test_every_command_has_help_and_loads_nothing_heavy():
    code = (
        "import sys; from dbvfiv.cli.main import build; commands = build().commands.values();"
        "print([c.callback.__module__ for c in commands if not c.callback.__doc__]);"
        "heavy = 'jax numpy scipy petsc4py numba pint matplotlib h5py plotly pyvista'.split();"
        "print([m for m in heavy if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.split("\n")[:2] == ["[]", "[]"], done.stdout + done.stderr


def test_version(command_line):
    outcome = command_line("--version")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert outcome.status == 0 and outcome.out.split()[:2] == ["dbvfiv", project["version"]]
    assert f"version: {project['version']}" in (ROOT / "CITATION.cff").read_text().splitlines()


@pytest.mark.parametrize(
    "failure, status",
    [
        (CaseError("drive.pressure is wrong."), 2),
        (SolveError("No equilibrium was found at 3 kPa after 12 halvings of the load step."), 1),
        (KeyboardInterrupt(), 130),
        (FileNotFoundError(2, "No such file or directory", "x.h5"), 1),
        (ZeroDivisionError("division\nby zero"), 3),
    ],
)
def test_failures_become_exit_statuses(monkeypatch, command_line, one_sentence, failure, status):
    def command() -> None:
        raise failure

    app = typer.Typer(add_completion=False)
    app.callback()(lambda: None)
    app.command("work")(command)
    monkeypatch.setattr(main, "build", lambda: typer.main.get_command(app))
    outcome = command_line("work")
    assert outcome.status == status
    assert outcome.out == ""
    assert one_sentence(outcome.err), outcome.err


def test_the_manual_has_every_exit_status():
    said = (ROOT / "docs/questions.md").read_text().partition("Exit status: ")[2].partition(";")[0]
    statuses = [int(number) for number in re.findall(r"\b\d+\b", main.run.__doc__.partition("Exit status: ")[2])]
    assert [int(number) for number in re.findall(r"\b\d+\b", said)] == statuses == [0, 1, 2, 3, 130, 143]


@pytest.mark.parametrize(("failure", "status"), [("KeyboardInterrupt()", 130), ("CaseError('It is wrong.')", 2)])
def test_a_reader_that_has_left_changes_no_status(failure, status):
    script = f"""
import sys, typer
from dbvfiv.cli import main
from dbvfiv.errors import CaseError
def work():
    print("found")
    raise {failure}
app = typer.Typer(add_completion=False)
app.callback()(lambda: None)
app.command("work")(work)
main.build = lambda: typer.main.get_command(app)
sys.stdin.readline()
sys.exit(main.run(["work"]))
"""
    pipes = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
    held = os.environ | {"PYTHONUNBUFFERED": ""}  # the pipe is written when the command reports
    with subprocess.Popen([sys.executable, "-c", script], text=True, env=held, **pipes) as process:
        process.stdout.close()
        process.stdin.write("go\n")
        process.stdin.close()
        told = process.stderr.read()
    assert process.returncode == status and told.count("\n") == 1, told


def test_case_as_json(command_line, tmp_path):
    (tmp_path / "a.toml").write_text("[drive]\npressure = '36 kPa'")
    outcome = command_line("case", tmp_path / "a.toml", "--json", "--set", "fluid.density=10")
    document = json.loads(outcome.out)
    assert document["drive"]["pressure"] == 36e3 and document["fluid"]["density"] == 10
    assert Case.from_dict(document).drive.pressure == 36e3
    assert outcome.err == ""


def test_case_printed_can_be_used_again(command_line, tmp_path):
    first = command_line("case", "--all", "--set", "drive.pressure=36 kPa")
    (tmp_path / "a.toml").write_text(first.out)
    assert command_line("case", tmp_path / "a.toml", "--all").out == first.out


def test_a_new_case_is_commented_valid_and_never_overwrites(command_line, misused, tmp_path):
    file = tmp_path / "new.toml"
    assert command_line("case", "--new", file, "--set", "fluid.density=1.2").status == 0
    text = file.read_text()
    assert "# Static pressure" in text and 'density = "1.2 kg/m^3"' in text
    assert command_line("case", file).status == 0
    assert '\ncontinuity = "storage"' in text and "inline valve, but for fluid.density." in text.replace("\n# ", " ")
    assert load_case(file) == load_case(None, ["fluid.density=1.2"])
    misused("", "case", "--new", file)
    misused("", "case", "--new", tmp_path / "no" / "folder.toml")
    assert file.read_text() == text
    assert command_line("case", "--new").status == 2


@pytest.mark.parametrize(
    "key, words",
    [
        ("drive.pressure", ["drive.pressure", "18 kPa", "pressure"]),
        ("drive", ["drive.kind", "drive.side"]),
        ("layers.2.angle", ["layers[].angle", "54"][:1]),
        ("materials", ["materials.strain_level", "materials.NAME(fit).path"]),
        ("continuity", ["fluid.continuity", "quasi-steady"]),
    ],
)
def test_explain(command_line, key, words):
    outcome = command_line("case", "--explain", key)
    assert outcome.status == 0
    assert all(word in outcome.out for word in words), outcome.out


def test_explain_everything_as_json(command_line):
    keys = {entry["key"]: entry for entry in json.loads(command_line("case", "--explain", "--json").out)["keys"]}
    assert keys["drive.pressure"]["default"] == 18e3 and keys["drive.pressure"]["unit"] == "Pa"
    assert len(keys) > 80


def test_doctor(command_line):
    outcome = command_line("doctor", "--json")
    report = json.loads(outcome.out)
    assert outcome.status == 0 and report["healthy"]
    assert report["petsc"]["scalar"] in ("real", "complex")
    assert "petsc" in report["petsc"]["solvers"]
    assert "PETSc" in command_line("doctor").out


def test_petsc_of_debian_is_found_for_this_python_alone(tmp_path):
    from dbvfiv.runtime import debian_petsc

    this = f"cpython-{sys.version_info.major}{sys.version_info.minor}"
    for kind, python in (("real", "cpython-39"), ("complex", this)):
        for package in ("petsc", "slepc"):
            folder = tmp_path / f"{package}dir/{package}3.18/x86_64-{kind}/lib/python3/dist-packages/{package}4py/lib"
            folder.mkdir(parents=True)
            (folder / f"{package}.{python}-x86_64-linux-gnu.so").touch()
    found = debian_petsc(tmp_path)
    assert [path.split("/")[-6:-3] for path in found] == [
        [f"{p}dir", f"{p}3.18", "x86_64-complex"] for p in ("petsc", "slepc")
    ]
    assert debian_petsc(tmp_path / "nothing") == []


def test_doctor_names_the_remedy(monkeypatch, command_line):
    from dbvfiv import doctor

    real = doctor.importlib.util.find_spec
    hidden = types.SimpleNamespace(find_spec=lambda name: None if name == "petsc4py" else real(name))
    monkeypatch.setattr(doctor.importlib, "util", hidden)
    outcome = command_line("doctor")
    assert outcome.status == 1
    assert "petsc4py" in outcome.out and ("make setup" in outcome.out or "conda" in outcome.out)


def test_json_of_arrays_and_of_what_is_not_finite(capsys):
    import numpy as np

    print_json({"a": np.array([1.0, np.nan]), "b": np.float64(2), "c": (1, None), "d": 1 + 2j})
    assert json.loads(capsys.readouterr().out) == {
        "a": [1.0, None],
        "b": 2.0,
        "c": [1, None],
        "d": {"re": 1.0, "im": 2.0},
    }


def test_an_answer_is_told_where_its_figure_fails(capsys, tmp_path):
    """In JSON too; and where a film alone was asked for, its folder is named."""

    class Drawn(types.SimpleNamespace):
        drawable, interrupted, record = True, False, types.SimpleNamespace(settled=None)
        case = types.SimpleNamespace(units=types.SimpleNamespace(say=str))
        summary, lines, shortfall = (lambda self: {"a": 1}), (lambda self: ["a 1"]), (lambda self: None)

        def plot(self, folder):
            raise SolveError("No figure.")

    with pytest.raises(SolveError, match="No figure"):
        _report(Drawn(), None, tmp_path, True)
    assert json.loads(capsys.readouterr().out) == {"a": 1, "output": None, "figures": []}
    _report(Drawn(), None, None, False, further=lambda result: [tmp_path / "run.gif"])
    assert capsys.readouterr().out == f"a 1\n1 figure in {tmp_path}.\n"


def test_a_result_that_cannot_be_written_is_refused_before_the_work(tmp_path, capsys):
    notes = tmp_path / "notes.md"
    notes.write_text("not a result")
    assert run(["sweep", "--over", "density=1:1000:9", "-o", str(notes)]) == 2
    said = capsys.readouterr()
    assert "notes.md" in said.err and "not overwritten" in said.err and said.out == ""
    assert run(["modes", "-o", str(notes / "a.h5")]) == 2
    assert "a.h5" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["notes.md"]


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (("identify", "--case", "{}/mine.toml"), "mine.toml.* exists already and is not overwritten"),
        (("identify", "--case", "{}/mine.toml/known.toml"), "known.toml.* cannot be written"),
        (("design", "--cases", "{}/designs"), "design-1.toml.* exists already and is not overwritten"),
        (("design", "--cases", "{}/mine.toml"), "cannot be written"),
    ],
)
def test_a_case_file_that_cannot_be_written_is_refused_before_the_work(tmp_path, misused, command, words):
    for path in (tmp_path / "mine.toml", tmp_path / "designs" / "design-1.toml"):
        path.parent.mkdir(exist_ok=True)
        path.write_text("# of one's own\n")
    misused(words, *(part.format(tmp_path) for part in command))


def test_a_folder_for_figures_that_cannot_be_made_is_refused_first(misused, tmp_path, monkeypatch):
    monkeypatch.setattr(Session, "perform", lambda *_, **__: pytest.fail("something was computed"))
    (tmp_path / "file").write_text("")
    misused("--plots", "steady", "-p", "6 kPa", "--plots", tmp_path / "file" / "figures")
