"""Report on fits to tests of a rubber: all energy forms compared, one of them in full, and its table to paste."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from dbvfiv.fit.curves import CycleReport, TensionTest, describe_cycles, loading_tests
from dbvfiv.fit.rubber import RubberFit, all_forms, fit_rubber, form_of
from dbvfiv.materials.laws import MaterialError

#: Condition number above which constants say little of states that were not tested.
ILL_CONDITIONED = 100.0
#: Change of the largest stress from cycle to cycle below which a rubber counts as stabilised.
STABILISED = 0.02


@dataclass(frozen=True)
class FitReport:
    """Fits to the same tests: of every form, with those refused and why; the one told in full, and the same form
    fitted to the first loading, where a test has several cycles, the last is the one fitted and the first can be.
    """

    tests: tuple[TensionTest, ...]
    cycles: list[CycleReport]
    fits: list[RubberFit]
    refused: dict[str, str]
    chosen: RubberFit
    first: RubberFit | None

    @property
    def loss_factor(self) -> float | None:
        """Mean of the loops of the last cycle of each test; None without a loop."""
        last = {cycle.mode: cycle.loss_factor for cycle in self.cycles}
        known = [value for value in last.values() if np.isfinite(value)]
        return float(np.mean(known)) if known else None

    def lines(self, name: str, density: float) -> list[str]:
        """Lines of the report as text."""
        tests = [f"{t.mode} {t.strain.min():.1%} to {t.strain.max():.1%} in {t.stress.size} points" for t in self.tests]
        table = toml_table(self.chosen, name, density, self.loss_factor)
        head = ["Tests: " + "; ".join(tests) + ".", ""]
        return [*head, *self._of_cycles(), *self._of_forms(), "", *self._of_chosen(), "", *table]

    def summary(self, name: str, density: float) -> dict[str, Any]:
        """For programs; strains are fractions, stresses Pa."""
        return {
            "tests": [{"mode": t.mode, "points": t.stress.size, "largest_strain": t.strain.max()} for t in self.tests],
            "cycles": [vars(cycle) for cycle in self.cycles],
            "loss_factor": self.loss_factor,
            "fits": [_summary(fit) for fit in self.fits],
            "refused": self.refused,
            "chosen": _summary(self.chosen),
            "first_loading": None if self.first is None else _summary(self.first),
            "toml": "\n".join(toml_table(self.chosen, name, density, self.loss_factor)),
        }

    def _of_cycles(self) -> list[str]:
        if not self.cycles:
            return []
        rows = ["test      cycle  largest strain  stress there, MPa  set      tan delta"]
        for c in self.cycles:
            loss = f"{c.loss_factor:.4f}" if np.isfinite(c.loss_factor) else "no way back"
            rows.append(
                f"{c.mode:9} {c.cycle:5d}  {c.peak_strain:14.1%}  {c.peak_stress / 1e6:17.4g}  {c.set_strain:7.2%}  "
                f"{loss}"
            )
        for mode in dict.fromkeys(c.mode for c in self.cycles):
            peaks = [c.peak_stress for c in self.cycles if c.mode == mode]
            if len(peaks) > 1 and peaks[-2] > 0.0:
                change = abs(peaks[-1] / peaks[-2] - 1)
                done = "stabilised" if change <= STABILISED else "not stabilised yet"
                rows.append(f"The largest {mode} stress changes by {change:.1%} in the last cycle: {done}.")
        if self.first is not None:
            ratio = self.chosen.shear_modulus / self.first.shear_modulus
            rows.append(
                "Fitted: the last loading, from its set. "
                f"The first loading gives {_constants(self.first)}: shear modulus "
                f"{self.first.shear_modulus / 1e6:.4g} MPa, of which the last cycle keeps {ratio:.0%} (Mullins)."
            )
        if self.loss_factor is not None:
            rows.append(
                f"Loss factor {self.loss_factor:.3f}, by the loops of the last cycle; it holds for their strain and "
                "rate."
            )
        return [*rows, ""]

    def _of_forms(self) -> list[str]:
        rows = [f"{'form':16} {'rms, MPa':>9}  {'R2':>8}  {'condition':>9}  {'mu, MPa':>8}  stable to"]
        for fit in self.fits:
            reach = _strain(fit.stable_range.equivalent_strain)
            rows.append(
                f"{fit.form.title:16} {fit.rms / 1e6:9.4g}  {fit.r_squared:8.5f}  {fit.condition_number:9.3g}  "
                f"{fit.shear_modulus / 1e6:8.4g}  {reach:>9}"
            )
        rows += [f"{title}: {why}" for title, why in self.refused.items()]
        rows.append(
            "Stable to: strain in tension up to which, or as far from rest in any state, the rubber is stable; the "
            f"tests reach {_strain(max(fit.reach for fit in self.fits))}."
        )
        return rows

    def _of_chosen(self) -> list[str]:
        fit = self.chosen
        limit = {"none": "no constraint", "non-negative": "constants at least 0", "stable": "stable"}[fit.constraint]
        limit += ", which changes the answer" if fit.active else ""
        if fit.form.softens:
            limit = "stable in every state by its form, whatever the tests"
        rows = [f"{fit.form.title}, {limit}: {_constants(fit)}."]
        for test, left in zip(fit.tests, fit.by_test):
            worst = int(np.argmax(np.abs(left)))
            rows.append(
                f"  {test.mode}: residual {np.sqrt(np.mean(left**2)) / 1e6:.3g} MPa rms, largest "
                f"{left[worst] / 1e6:.3g} MPa at {test.strain[worst]:.1%}"
            )
        span = fit.stable_range
        for name, ends in (("uniaxial", span.uniaxial), ("planar", span.pure_shear), ("biaxial", span.equibiaxial)):
            rows.append("  stable in {} stretch from {:.4g} to {:.4g}".format(name, *ends))
        if span.equivalent_strain < fit.reach:
            rows.append(
                "  Beware: these constants lose stability within the strains of the tests, in states that were not "
                "tested; use --constraint stable, or more kinds of test."
            )
        if fit.condition_number > ILL_CONDITIONED and not fit.form.softens:  # its constants cannot cancel each other
            rows.append(
                f"  Beware: a condition number of {fit.condition_number:.3g} means that the constants describe these "
                "tests and say little of other states of strain."
            )
        return rows


def describe_fits(
    curves: list[TensionTest],
    law: str | None = None,
    terms: int | None = None,
    constraint: str = "none",
    stable_to: float | None = None,
    error: str = "absolute",
    cycle: str = "last",
) -> FitReport:
    """Fit every form, and tell one in full. Raises MaterialError for options that there are not, or tests that no form
    can be fitted to.

    `law` and `terms` are the form told in full; the softening rubber if not given and the tests suffice for it, else of
    those but Ogden's that are stable as far as the tests reach the one of least residual. For the other options see
    `rubber.fit_rubber` and `curves.loading_tests`.
    """
    if law is None and terms is not None:
        raise MaterialError("A number of terms needs the law they belong to.")
    forms = list(all_forms())
    wanted = None if law is None else form_of(law, terms)
    if wanted is not None and wanted not in forms:
        forms.append(wanted)
    tests = loading_tests(curves, cycle)
    fits, refused = [], {}
    for form in forms:
        try:
            fits.append(fit_rubber(tests, form, constraint, stable_to, error))
        except MaterialError as problem:
            if form == (wanted or forms[0]):
                raise
            refused[form.title] = str(problem)
    chosen = next(f for f in fits if f.form == wanted) if wanted else _best(fits)
    many = any(len({c.cycle for c in curves if c.mode == mode}) > 1 for mode in {c.mode for c in curves})
    first = None
    if many and cycle == "last":
        try:
            first = fit_rubber(loading_tests(curves, "first"), chosen.form, constraint, stable_to, error)
        except MaterialError as problem:
            refused["first loading"] = str(problem)
    return FitReport(tests, describe_cycles(curves), fits, refused, chosen, first)


def _best(fits: list[RubberFit]) -> RubberFit:
    """Least residual, the softening rubber and the stable ones first; Ogden's exponents are taken where asked for."""
    possible = [f for f in fits if f.form.name != "ogden" and f.shear_modulus > 0.0]
    if not possible:
        raise MaterialError("No fit finds a positive stiffness; does stress grow with strain in the tests?")
    return min(possible, key=lambda f: (not f.form.softens, f.stable_range.equivalent_strain < f.reach, f.rms))


def toml_table(fit: RubberFit, name: str, density: float, loss_factor: float | None = None) -> list[str]:
    """The fitted rubber as a table of a case file; why there is none, as a remark."""
    if fit.shear_modulus <= 0.0:
        return ["# These constants have no positive shear modulus: no wall can be made of them."]
    kind, values = fit.form.name, dict(zip(fit.form.names, fit.constants))
    if kind == "neo-hookean":
        values = {"shear_modulus": fit.shear_modulus}
    rows = [f"[materials.{name}]", f'kind = "{kind}"']
    if kind == "ogden":
        rows.append("mu = [" + ", ".join(f'"{value / 1e6:.12g} MPa"' for value in fit.constants) + "]")
        rows.append("alpha = [" + ", ".join(f"{value:.12g}" for value in fit.exponents) + "]")
    else:
        rows += [f'{key} = "{value / 1e6:.12g} MPa"' for key, value in values.items()]
        rows += [f"{key} = {value:.12g}" for key, value in zip(fit.form.exponent_names, fit.exponents)]
    rows.append(f'density = "{density:g} kg/m^3"')
    if loss_factor is not None:
        rows.append(f"loss_factor = {loss_factor:.4g}")
    return rows


def _constants(fit: RubberFit) -> str:
    names = [*fit.form.names, *fit.form.exponent_names]
    errors = fit.standard_errors
    told = [f"{n} = {c / 1e6:.6g} +- {e / 1e6:.2g} MPa" for n, c, e in zip(names, fit.constants, errors)]
    count = len(told)
    told += [f"{n} = {c:.6g} +- {e:.2g}" for n, c, e in zip(names[count:], fit.exponents, errors[count:])]
    return ", ".join(told)


def _strain(equivalent: float) -> str:
    """Engineering strain of the tension of an equivalent logarithmic strain."""
    return f"{np.expm1(equivalent):.1%}" if np.isfinite(equivalent) else "no limit"


def _summary(fit: RubberFit) -> dict[str, Any]:
    return {
        "law": fit.form.name,
        "terms": fit.form.terms,
        "constants": dict(zip(fit.form.names, fit.constants)),
        "exponents": fit.exponents,
        "standard_errors": fit.standard_errors,
        "constraint": fit.constraint,
        "active": fit.active,
        "rms": fit.rms,
        "r_squared": fit.r_squared,
        "condition_number": fit.condition_number,
        "shear_modulus": fit.shear_modulus,
        "stable_equivalent_strain": fit.stable_range.equivalent_strain,
        "tested_equivalent_strain": fit.reach,
        "wall": True,  # each form has a law
        "residuals": fit.by_test,
    }
