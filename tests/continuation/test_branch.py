"""Following a branch: steps, limits, endings, events, files, resumption."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import h5py
import jax.numpy as jnp
import numpy as np
import pytest

from continuation import (
    Branch,
    Checkpoint,
    ContinuationOptions,
    Event,
    NewtonOptions,
    NotConverged,
    OutOfDomain,
    Reason,
    continue_branch,
    resume,
)
from continuation.jax_system import JaxSystem
from tests.continuation.known import cusp, stuart_landau
from tests.systems.following import Stop, follow

MU = {"a": -2.0, "b": 1.0}
LIMITS = {"a": (-2.0, 2.0)}


def circle():
    """u^2 + p^2 = 1: a closed curve with two folds."""
    return JaxSystem(lambda u, mu: u**2 + mu["p"] ** 2 - 1.0, 1)


def on_cusp(events=(), observers=None, **options):
    return continue_branch(
        cusp(), [-1.5], MU, "a", ContinuationOptions(limits=LIMITS, **options), events, observers=observers
    )


def s_curve(**options):
    """Branch whose arclength is that of the plane of ``x`` and ``a``."""
    return on_cusp(state_scale=1.0, parameter_scales={"a": 1.0}, **options)


def test_every_point_is_an_equilibrium_and_the_end_is_the_limit():
    branch = s_curve()
    assert branch.reason == "ended on the limit a = 2"
    assert branch.values()[-1] == 2.0
    assert np.all(branch.values() <= 2.0)
    x, a = branch.states[:, 0], branch.values()
    assert np.abs(a + x - x**3).max() < 1e-9
    # All three states at a = 0 were passed: one root each of x - x^3 near a sign change.
    assert np.sum(np.diff(np.sign(a)) != 0) == 3


def test_tangents_are_unit_vectors_along_the_curve():
    branch = s_curve(max_step=0.1)
    for before, after in zip(branch.points, branch.points[1:]):
        chord = after.z - before.z
        assert np.isclose(np.linalg.norm(before.tangent), 1.0)
        assert before.tangent @ chord > 0.9 * np.linalg.norm(chord)


def test_angle_between_tangents_is_limited():
    branch = s_curve(max_angle=0.1)
    angles = [np.arccos(min(1.0, p.tangent @ q.tangent)) for p, q in zip(branch.points, branch.points[1:])]
    assert max(angles) <= 0.1 + 1e-12
    assert len(branch) > len(s_curve(max_angle=0.5))


def test_direction_backwards():
    branch = continue_branch(cusp(), [1.5], {"a": 2.0, "b": 1.0}, "a", ContinuationOptions(limits=LIMITS, direction=-1))
    assert branch.values()[-1] == -2.0
    assert len(branch.of_kind("fold")) == 2


def test_starting_on_a_limit_and_leaving_it_ends_at_once():
    branch = continue_branch(cusp(), [1.5], {"a": 2.0, "b": 1.0}, "a", ContinuationOptions(limits=LIMITS))
    assert len(branch) == 1 and branch.reason == "ended on the limit a = 2"


def test_a_closed_curve_is_recognised():
    branch = continue_branch(circle(), [1.0], {"p": 0.0}, "p", ContinuationOptions(max_step=0.2))
    assert branch.reason.kind is Reason.CLOSED
    folds = sorted(s.mu["p"] for s in branch.of_kind("fold"))
    assert np.allclose(folds, [-1.0, 1.0], rtol=0, atol=1e-10)
    u, p = branch.states[:, 0], branch.values()
    total = np.abs(np.diff(np.unwrap(np.arctan2(p, u)))).sum()
    assert 2 * np.pi * 0.95 < total < 2 * np.pi * 1.15


def test_start_exactly_at_a_fold():
    """F_u = 0 at the first point; the natural frame is singular there."""
    branch = continue_branch(circle(), [0.0], {"p": 1.0}, "p", ContinuationOptions(max_step=0.2))
    assert np.abs(branch.states[:, 0] ** 2 + branch.values() ** 2 - 1).max() < 1e-9
    assert len(branch) > 10


def test_events_are_located_and_can_end_the_branch(tmp_path):
    crossing = Event("x/2 is 1/4", lambda u, mu: u[0] - 0.5)
    branch = on_cusp([crossing])
    branch.save(tmp_path / "branch.h5")
    again = Branch.load(tmp_path / "branch.h5")
    assert np.array_equal(again.values(crossing.name), branch.values(crossing.name))
    (point,) = again.of_kind(crossing.name)
    assert abs(point.u[0] - 0.5) < 1e-9 and abs(point.mu["a"] + 0.5 - 0.125) < 1e-9
    short = on_cusp([Event("x is one half", lambda u, mu: u[0] - 0.5, stop=True)])
    assert short.reason == "stopped at: x is one half" and len(short) < len(branch)


def test_stop_at_a_kind():
    branch = s_curve(stop_at=frozenset({"fold"}))
    assert branch.reason == "stopped at: fold" and len(branch.of_kind("fold")) == 1


def test_no_equilibrium_at_the_start_is_an_error():
    with pytest.raises(NotConverged, match="first point was not found"):
        continue_branch(circle(), [0.1], {"p": 5.0}, "p", ContinuationOptions(newton=NewtonOptions(max_iterations=3)))


def test_wrong_shape_and_unknown_parameter():
    with pytest.raises(ValueError, match="needs"):
        continue_branch(circle(), [0.0, 1.0], {"p": 0.0}, "p")
    with pytest.raises(KeyError, match="'q' is not one of: p"):
        continue_branch(circle(), [1.0], {"p": 0.0}, "q")


def test_a_domain_that_ends_keeps_the_points_up_to_there():
    """log(1 - p) leaves the reals at p = 1, with nothing to find beyond."""
    system = JaxSystem(lambda u, mu: u - jnp.log(1.0 - mu["p"]), 1)
    branch = continue_branch(system, [0.0], {"p": 0.0}, "p", ContinuationOptions(max_points=50, max_step=2.0, step=0.5))
    assert np.all(np.isfinite(branch.states))
    assert np.all(branch.values() < 1.0) and len(branch) > 3 and branch.values()[-1] > 0.5


def test_a_model_may_say_that_it_ends():
    class Ending(JaxSystem):
        def residual(self, u, mu):
            if mu["p"] > 1.0:
                raise OutOfDomain("the lips would cross")
            return super().residual(u, mu)

    stop = Stop(after=-1)
    branch = continue_branch(
        Ending(lambda u, mu: u - mu["p"], 1), [0.0], {"p": 0.0}, "p", ContinuationOptions(max_points=60), observers=stop
    )
    assert branch.reason.endswith("outside the domain of the model: the lips would cross")
    assert 1.0 - 1e-6 < branch.values()[-1] <= 1.0


def test_interruption_keeps_points_and_resuming_gives_the_same_branch(tmp_path):
    path = tmp_path / "branch.h5"
    whole, stop = on_cusp(eigenvalues=1), Stop(after=8)
    part = on_cusp(observers=[stop, Checkpoint(path, 3)], eigenvalues=1)
    assert part.reason.kind is Reason.INTERRUPTED and len(part) == 8 and stop.end == 1
    loaded = Branch.load(path)
    assert loaded.reason.kind is Reason.INTERRUPTED and len(loaded) == 8
    longer = resume(cusp(), loaded, ContinuationOptions(limits=LIMITS, eigenvalues=1))
    assert len(loaded) == 8  # the one handed over stays as it is
    assert longer.reason == whole.reason and len(longer) == len(whole)
    assert np.allclose(longer.values(), whole.values(), rtol=0, atol=1e-9)
    assert [s.kind for s in longer.special] == [s.kind for s in whole.special]


def test_observers_hear_of_refusals_and_finds():
    stop = Stop(after=-1)
    on_cusp(observers=stop, step=0.5, max_angle=0.15)
    assert stop.finds == ["fold", "fold"]
    assert stop.refusals and all(step > 0 for _, step in stop.refusals)


def test_a_plain_function_is_an_observer():
    lengths = []
    branch = on_cusp(observers=lambda b: lengths.append(len(b)))
    assert lengths == list(range(2, len(branch) + 1))


def test_file_holds_everything(tmp_path):
    path = tmp_path / "b.h5"
    system = stuart_landau()
    branch = follow(system, [0, 0], {"mu": -0.5, "w": 2.0, "c": 0.7}, "mu", (-1, 1))
    branch.save(path)
    again = Branch.load(path)
    assert not path.with_name("b.h5.partial").exists()
    for name in ("kind", "size", "names", "extra_names", "fixed", "reason", "next_step"):
        assert getattr(again, name) == getattr(branch, name)
    for one, two in zip(branch.points, again.points, strict=True):
        for name in ("step", "iterations", "residual", "unstable"):
            assert getattr(one, name) == getattr(two, name)
        assert one.tests == two.tests and np.array_equal(one.eigenvalues, two.eigenvalues)
    assert np.array_equal(again.states, branch.states)
    assert np.array_equal(again.values("fold"), branch.values("fold"))
    one, two = branch.of_kind("hopf")[0], again.of_kind("hopf")[0]
    assert np.array_equal(one.vectors["right"], two.vectors["right"])
    assert one.values == two.values


@pytest.mark.slow
def test_a_killed_run_resumes_from_its_checkpoint(tmp_path):
    """kill -9 in the middle of a step; nothing but the file survives."""
    path = tmp_path / "killed.h5"
    script = f"""
import os, signal
from continuation import Checkpoint, ContinuationOptions, continue_branch
from tests.systems.normal_forms import cusp
def die(branch):
    if len(branch) == 11:
        os.kill(os.getpid(), signal.SIGKILL)
continue_branch(cusp(), [-1.5], {MU}, "a", ContinuationOptions(limits={LIMITS}, parameter_scales={{"a": 1.0}}),
                observers=[Checkpoint({str(path)!r}, 5), die])
"""
    root = Path(__file__).parents[2]
    ended = subprocess.run(
        [sys.executable, "-c", script], cwd=root, env={**os.environ, "PYTHONPATH": str(root)}, capture_output=True
    )
    assert ended.returncode == -signal.SIGKILL, ended.stderr
    left = Branch.load(path)
    assert len(left) == 10 and left.reason.kind is Reason.RUNNING
    whole = on_cusp(parameter_scales={"a": 1.0})
    longer = resume(cusp(), left, ContinuationOptions(limits=LIMITS, parameter_scales={"a": 1.0}))
    assert len(longer) == len(whole)
    assert np.allclose(longer.values(), whole.values(), rtol=0, atol=1e-9)


def test_an_error_of_the_model_keeps_the_branch(tmp_path):
    class Breaking(JaxSystem):
        def residual(self, u, mu):
            if mu["p"] > 1.0:
                raise RuntimeError("disk full")
            return super().residual(u, mu)

    path = tmp_path / "b.h5"
    with pytest.raises(RuntimeError, match="disk full") as error:
        continue_branch(Breaking(lambda u, mu: u - mu["p"], 1), [0.0], {"p": 0.0}, "p", observers=Checkpoint(path))
    kept = error.value.branch
    assert len(kept) > 3 and kept.reason == "met an error: disk full"
    assert len(Branch.load(path)) == len(kept)


def test_an_event_that_is_not_a_number_is_no_crossing():
    event = Event("root", lambda u, mu: np.sqrt(mu["a"]) if mu["a"] >= 0 else np.nan)
    branch = on_cusp([event])
    assert not branch.of_kind("root", located=False) and len(branch) > 10


def test_a_foreign_file_is_refused(tmp_path):
    path, text = tmp_path / "x.h5", tmp_path / "x.txt"
    with h5py.File(path, "w") as file:
        file["y"] = 1
    text.write_text("y = 1")
    for foreign in (path, text):
        with pytest.raises(ValueError, match="not a branch file"):
            Branch.load(foreign)


def test_plot_draws_stability_and_special_points():
    import matplotlib

    matplotlib.use("Agg")
    branch = s_curve(eigenvalues=1)
    ax = branch.plot(0)
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert labels == ["fold"]
    drawn = [np.isfinite(line.get_ydata()).sum() for line in ax.lines if line.get_linestyle() == "--"]
    assert drawn == [np.sum(branch.unstable > 0)] and ax.get_ylabel() == "unknown 0"
    assert len({line.get_color() for line in ax.lines if line.get_marker() == "s"}) == 1
    assert branch.plot().get_ylabel() == "largest |u|" and branch.plot("fold").get_ylabel() == "fold"
    with pytest.raises(KeyError, match="no 'height'"):
        branch.plot("height")


@pytest.mark.parametrize("unit", [1e3, 1e-6])
def test_units_of_the_state_do_not_matter(unit):
    """Both folds with the default options, and the same points but for rounding."""
    system = JaxSystem(lambda u, mu: mu["a"] + u / unit - (u / unit) ** 3, 1)
    plain = on_cusp()
    branch = continue_branch(system, [-1.5 * unit], {"a": -2.0}, "a", ContinuationOptions(limits=LIMITS))
    assert np.allclose([s.mu["a"] for s in branch.special], [2 / np.sqrt(27), -2 / np.sqrt(27)], rtol=1e-8)
    assert np.allclose(branch.values(), plain.values(), rtol=0, atol=1e-6)


def test_scales_make_a_branch_in_other_units_the_same():
    """The same curve with the state in millis and the parameter in kilos."""

    def other(u, mu):
        x, a = u * 1e-3, mu["a"] * 1e3
        return a + x - x**3

    branch = continue_branch(
        JaxSystem(other, 1),
        [-1500.0],
        {"a": -2e-3},
        "a",
        ContinuationOptions(limits={"a": (-2e-3, 2e-3)}, state_scale=1e3, parameter_scales={"a": 1e-3}),
    )
    plain = s_curve()
    assert len(branch) == len(plain)
    assert np.allclose(branch.values() * 1e3, plain.values(), atol=1e-8)
