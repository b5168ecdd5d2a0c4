"""Numbers of the manual say where they come from, and every command that it shows can be given."""

from __future__ import annotations

import importlib.util
import pkgutil
import re
import shlex
import sys

import pytest

import benchmarks
from benchmarks.registry import BENCHMARKS
from dbvfiv import cli
from dbvfiv.case.parameters import PARAMETERS
from dbvfiv.cli import main, studies
from dbvfiv.studies import case as cases
from dbvfiv.studies.session import Session
from tests.pages import ROOT, blocks, command_lines, indented_commands, pages, tables

#: The page on flow laws sets a key that its reader adds; tests/flow/test_adding_a_law.py carries it out.
PAGES = [page for page in pages() if page.name != "adding-a-flow-law.md"]
STAMPED = [table for page in PAGES for table in tables(page) if table.has_numbers]


@pytest.fixture
def only_parsed(monkeypatch, capsys):
    """Give a command line to the program, up to the point at which it would begin to compute: options, case and keys
    are read and checked. A case file that is not there stands for the reader's own, of a valve in its fluid, and is
    left out.
    """
    load = cases.load_case
    kinds = [kind for kind, _ in studies.study_commands()]

    def perform(kind, case, request, *_):
        Session(case).prepared(kind, request.changes)

    def load_one(path, overrides):
        own = path is not None and not (ROOT / path).exists()
        return load(None if own else path, [*(["outside.fluid=same"] if own else []), *overrides])

    monkeypatch.setattr(cases, "load_case", load_one)
    monkeypatch.setattr(studies, "perform", perform)
    for name, command in main.build().commands.items():
        if name not in kinds:
            monkeypatch.setattr(command, "callback", lambda **given: None)
    monkeypatch.chdir(ROOT)

    def parse(line: str) -> str:
        """Nothing, or what is wrong with the line."""
        words = shlex.split(line)
        if lost := [word for word in words if word.startswith("cases/") and not list(ROOT.glob(word))]:
            return f"no {', '.join(lost)}"
        status = cli.run(words[1:])
        said = capsys.readouterr().err.strip()
        of_the_reader = (
            "which does not exist; it must be the name of a file" in said
        )  # the key is known, the file theirs
        return "" if status == 0 or of_the_reader else said or f"exit status {status}"

    return parse


def test_a_table_of_numbers_says_where_they_come_from():
    assert len(STAMPED) > 40
    silent = [f"{table.place} ({' | '.join(table.rows[0])[:60]})" for table in STAMPED if not table.quoted]
    assert not silent, f"Tables without a line below that says what made them: {silent}"


def test_what_made_a_table_exists():
    for module in pkgutil.iter_modules(benchmarks.__path__):
        if module.name != "__main__":
            importlib.import_module(f"benchmarks.{module.name}")
    wrong = []
    for table in STAMPED:
        for quoted in table.quoted:
            words = quoted.split()
            if words[0] == "python" and words[1:3] == ["-m", "benchmarks"]:
                wrong += [f"{table.place}: no benchmark {w}" for w in words[4:] if w not in BENCHMARKS]
            elif words[0] == "python":
                wrong += [] if (ROOT / words[1]).exists() else [f"{table.place}: no {words[1]}"]
            elif words[0].startswith(("tests/", "dbvfiv/", "cases/")):
                wrong += [] if list(ROOT.glob(words[0])) else [f"{table.place}: no {words[0]}"]
    assert not wrong, wrong


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_can_be_given(page, only_parsed):
    """Those of stamps and of code blocks: options are known, and keys that are set exist and take their values."""
    shown = [quoted for table in tables(page) for quoted in table.quoted]
    shown += [line for block in blocks(page) + blocks(page, "sh") for line in command_lines(block)] + indented_commands(
        page
    )
    if page.name in ("README.md", "questions.md", "findings.md"):
        shown += re.findall(r"`(dbvfiv [^`]+)`", page.read_text())
    wrong = {line: problem for line in shown if line.startswith("dbvfiv ") and (problem := only_parsed(line))}
    assert not wrong, wrong


def test_options_named_in_the_text_are_those_of_their_command():
    """Inline code such as `modes --law both`, with or without the program's name, up to an option's value."""
    commands, wrong = main.build().commands, []
    for page in PAGES:
        for quoted in re.findall(r"`([^`\n]+)`", page.read_text()):
            command, *words = quoted.removeprefix("dbvfiv ").split() or [""]
            if command in commands:
                known = [option for one in commands[command].params for option in (*one.opts, *one.secondary_opts)]
                named = [word.partition("=")[0] for word in words if re.match("--[a-z]", word)]
                wrong += [f"{page.name}: {quoted}" for option in named if option not in (*known, "--help")]
    assert not wrong, wrong


def test_the_manual_names_every_parameter():
    """That of onsets and maps, where their ranges are told."""
    (line,) = re.findall(r"^Parameters: .*$", (ROOT / "docs/stability.md").read_text(), re.M)
    assert set(re.findall(r"`(\w+)`", line)) == set(PARAMETERS)


def test_every_figure_says_which_command_makes_it(only_parsed):
    """tools/figures.py has each of them, and its commands can be given."""
    spec = importlib.util.spec_from_file_location("figures", ROOT / "tools/figures.py")
    figures = importlib.util.module_from_spec(spec)
    sys.modules["figures"] = figures  # dataclasses look it up
    try:
        spec.loader.exec_module(figures)
    finally:
        del sys.modules["figures"]
    made = [name for one in figures.ALL for name in one.figures.values()]
    assert sorted(made) == sorted(path.name for path in (ROOT / "docs/figures").iterdir())
    shown = set(re.findall(r"figures/([\w-]+\.\w+)\)", "".join(page.read_text() for page in pages())))
    assert shown == set(made)
    lines = [one.command.format(folder="out/figures/x") for one in figures.ALL]
    wrong = {line: problem for line in lines if line.startswith("dbvfiv ") and (problem := only_parsed(line))}
    assert not wrong, wrong
