"""The faces of the package in a script: names at the top, examples, texts of results, the operator of a state."""

import doctest
import importlib
import textwrap
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg

import dbvfiv
from continuation import ContinuationOptions, continue_branch
from dbvfiv.studies.case import thesis_case
from eigen import certified_spectrum, track
from tests.systems.beam import fluid_conveying_pipe
from tests.systems.brusselator import brusselator

LINES, WIDTH = 10, 200
ROOT = Path(__file__).parent.parent
WITH_EXAMPLES = [
    str(path.relative_to(ROOT).with_suffix("")).removesuffix("/__init__").replace("/", ".")
    for package in ("dbvfiv", "continuation", "eigen")
    for path in sorted((ROOT / package).rglob("*.py"))
    if ">>> " in path.read_text(encoding="utf-8")
]


def is_short(thing):
    lines = repr(thing).splitlines()
    return len(lines) <= LINES and max(map(len, lines)) <= WIDTH


@pytest.fixture(scope="module")
def valve():
    return dbvfiv.load(thesis_case(), {"mesh.around": 4, "mesh.along": 6})


@pytest.fixture(scope="module")
def state(valve):
    return valve.steady("12 kPa")


def test_results_are_named_at_the_top():
    for name in dbvfiv.__all__:
        assert getattr(dbvfiv, name).__doc__, name
    assert {"State", "SteadyResult", "ModesResult", "ClosureResult", "CycleResult"} <= set(dbvfiv.__all__)


@pytest.mark.parametrize("name", WITH_EXAMPLES)
def test_examples_give_what_they_show(name):
    assert doctest.testmod(importlib.import_module(name)).failed == 0


def test_pencil_of_a_state_has_the_eigenvalues_of_its_modes(state):
    modes, pencil = state.modes(count=2), state.pencil()
    assert pencil.M.shape == pencil.K.shape == (state.q.size,) * 2
    values = scipy.linalg.eigvals(*pencil.first_order())
    for found in modes.summary()["modes"]:
        value = complex(found["growth_rate"], 2 * np.pi * found["frequency"])
        assert abs(values - value).min() < 1e-7 * abs(value)


def reached(thing, depth=2, seen=None):
    """Objects of these packages that public attributes of one lead to, itself first."""
    seen = {} if seen is None else seen
    for one in thing[:2] if isinstance(thing, (list, tuple)) else [thing]:
        known = type(one).__module__.split(".")[0] in ("dbvfiv", "eigen", "continuation")
        if not known or id(one) in seen or isinstance(one, type) or callable(one):
            continue
        seen[id(one)] = one
        for name in [name for name in dir(one) if depth and not name.startswith(("_", "model_"))]:
            reached(getattr(one, name, None), depth - 1, seen)
    return list(seen.values())


def test_texts_of_all_that_a_result_leads_to_are_short(valve, state):
    """Case and sections, mesh, fields of layers, samples, verdicts: no arrays, ten lines at most."""
    modes = state.modes(count=2)
    for start in (valve, valve.damping(), state, modes, valve.sweep("density=10,20"), valve.closure(["100 Pa"])):
        long = {type(thing) for thing in reached(start) if not is_short(thing)}
        assert not long, f"{type(start).__name__} leads to {long}"
    text = repr(valve.case.valve)
    assert text.startswith("<Valve: duckbill_length 0.21, ") and len(text.splitlines()) > 1
    assert repr(modes.verdict).startswith("<Verdict: outcome 'stable', reason '0 unstable")


def test_texts_of_spectra_are_short_and_say_whether_they_are_certain():
    load = [fluid_conveying_pipe(u, 0.2, 8) for u in (1.0, 2.0)]
    found = certified_spectrum(load[0], 4), track(lambda u: load[int(u) - 1], [1.0, 2.0])
    for thing in [one for start in (*found, load[0]) for one in reached(start)]:
        assert is_short(thing), thing
    assert not any("object at" in repr(thing) for thing in (*found, load[0], found[0].count))
    assert "agree" in repr(found[0]) and "2 values, confidence at least" in repr(found[1])


def test_tables_come_with_units_and_ranges_as_arrays(valve):
    swept = valve.sweep({"density": np.array([10.0, 20.0, 100.0])})
    frame = swept.table("samples")
    assert list(frame["value"]) == [10.0, 20.0, 100.0] and frame.attrs["units"]["growth_rate"] == "1/s"
    grid = swept.table("states", form="xarray")
    assert grid["pressure"].attrs["units"] == "Pa" and grid["max_displacement_position"].shape == (1, 3)
    assert len(swept.table()) == sum(len(branch["growth_rate"]) for branch in swept.summary()["branches"])
    of_state = valve.steady(valve.case.drive.pressure).sweep({"density": [10, 20, 100]})
    for found in (valve.sweep("density=10,20,100"), of_state):
        assert found.summary()["values"] == swept.summary()["values"]
    with pytest.raises(dbvfiv.CaseError, match="'rows'.*branches"):
        swept.table("rows")
    for given in ({"density": [1]}, {"density": "10"}, {"density": [1, 2], "pressure": [1, 2]}):
        with pytest.raises(dbvfiv.CaseError, match="A range is given as"):
            valve.onset(given)


@pytest.mark.parametrize(
    "ask",
    [
        lambda valve: valve.steady(object()),
        lambda valve: valve.steady("6 kPa", output=5),
        lambda valve: valve.closure(object()),
        lambda valve: valve.levels(object()),
        lambda valve: valve.modes([1, 2]),
        lambda valve: valve.modes("6 kPa", count="x"),
        lambda valve: valve.modes(density="x"),
        lambda valve: valve.modes(foam=1),
        lambda valve: valve.sweep("density=10,20", in_vacuo=True),
        lambda valve: valve.sweep({"density": [10, 20]}, density=10),
        lambda valve: valve.map("alpha=0:40:3", "beta=1 ms:3 ms:3", beta="2 ms"),
        lambda valve: valve.onset(3),
        lambda valve: valve.sensitivity(5),
        lambda valve: valve.map("pressure=1000,2000", workers="two"),
        lambda valve: valve.transient([1]),
        lambda valve: valve.plot(5),
        lambda valve: valve.replace(5),
        lambda valve: dbvfiv.load(5),
        lambda valve: dbvfiv.load_result(5),
        lambda valve: dbvfiv.resume(5),
    ],
)
def test_wrong_types_are_answered_by_a_sentence(valve, ask):
    with pytest.raises(dbvfiv.CaseError) as refused:
        ask(valve)
    assert str(refused.value).endswith(".") and "given" in str(refused.value)


def test_texts_of_a_branch_and_its_points_are_short():
    options = ContinuationOptions(eigenvalues=2, limits={"B": (0.0, 4.0)})
    branch = continue_branch(brusselator(), [1.0, 0.5], {"A": 1.0, "B": 0.5}, "B", options)
    assert "ended on the limit B = 4" in repr(branch) and "hopf at A = 1, B = 2, located" in repr(branch)
    branch.special *= 20
    assert all(map(is_short, (branch, branch.points[0], branch.special[0]))) and "13 more" in repr(branch)


SCRIPTS = {
    "valve": """
        import dbvfiv

        valve = dbvfiv.load("cases/dbv12.toml", {"mesh.around": 4})
        state = valve.steady("12 kPa")
        print(state.mass_flow, state.pencil().K.shape)
        print(state.modes(count=3).plot("figures"), valve.onset().summary())
    """,
    "own equations": """
        import jax.numpy as jnp

        from continuation import ContinuationOptions, continue_branch
        from continuation.jax_system import JaxSystem

        system = JaxSystem(lambda u, mu: jnp.stack([mu["a"] + u[0] - u[0] ** 3]), 1)
        branch = continue_branch(system, [-1.5], {"a": -2.0}, "a", ContinuationOptions(limits={"a": (-2.0, 2.0)}))
        print(branch, branch.values(), [point.mu["a"] for point in branch.of_kind("fold")])
    """,
    "own operator": """
        import numpy as np

        from eigen import CoupledPencil

        pencil = CoupledPencil(M=np.eye(2), C=0.1 * np.eye(2), K=np.diag([1.0, 4.0]))
        print(pencil.n, [part.shape for part in pencil.first_order()])
    """,
}


WRONG = """
    import dbvfiv

    valve = dbvfiv.load("cases/dbv12.toml", {"mesh.around": 4})
    valve.steady("12 kPa").mass_flux
    valve.onset(3)
"""


@pytest.mark.slow
def test_a_type_checker_finds_what_is_wrong_with_a_script(tmp_path):
    api = pytest.importorskip("mypy.api", reason="the package mypy is not installed")
    (tmp_path / "wrong.py").write_text(textwrap.dedent(WRONG))
    options = ["--cache-dir", str(tmp_path), "--ignore-missing-imports", "--follow-imports=silent"]
    said, _, _ = api.run([*options, str(tmp_path / "wrong.py")])
    assert "mass_flux" in said and '"onset" of "Valve"' in said and "Found 2 errors" in said, said


@pytest.mark.slow
def test_a_type_checker_finds_nothing_wrong_with_three_scripts(tmp_path):
    api = pytest.importorskip("mypy.api", reason="the package mypy is not installed")
    files = []
    for name, text in SCRIPTS.items():
        files.append(tmp_path / f"{name.replace(' ', '_')}.py")
        files[-1].write_text(textwrap.dedent(text))
    said, errors, status = api.run(
        ["--cache-dir", str(tmp_path), "--ignore-missing-imports", "--follow-imports=silent", *map(str, files)]
    )
    assert status == 0, said + errors
