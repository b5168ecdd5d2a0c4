"""Identification of a valve by measured records: run, storage, and what can be read off it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import asdict, replace
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy.special import ndtri

from ...case.distribution import ALLOWED, Distribution
from ...case.parameters import PARAMETERS
from ...case.write import write_case
from ...drawing.style import ACCENT, COMPUTED, REST, headline, new_figure, parameter_label
from ...errors import CaseError, SolveError
from ...model.symmetry import equilibria_of, only_class_of
from ...record.record import GrowingRecord, Record
from ...texts import digits, json_value
from ..case import Case
from ..inputs import Plan, correlation_of, inputs_of
from ..result import StudyResult
from ..session import Session, Study
from ..stability.place import check_scan, describe_fixed, require_head
from ..stability.walk import StabilityWalk
from ..workers import Workers
from .learning import MORE, Learned, Learning, coordinates
from .search import (
    BEGINS,
    POSTERIOR,
    SPECTRA,
    TABLES,
    VALVES,
    Search,
    kept_modes,
    kept_onsets,
    learned_from,
    prepare_valves,
)
from .valves import Measured, Places, Valves, own_modes, records_said

_MEASURED, _FOUND = "measured", "found"
#: Standard deviations of the prior beyond which the records are doubted.
UNLIKELY = 3.0
#: Quantiles of an interval, and values that stand for a distribution of no simple form.
INTERVAL, STEPS = (0.025, 0.5, 0.975), 41
#: Probability below which nothing is said of what may be.
RARE = 0.025
#: Relative width of a distribution that the records leave one value of.
NARROW = 2e-6
#: Distance of the distribution function of a posterior from that of its form up to which the form stands for it, and
#: least correlation that is kept.
FORM, KEPT = 0.06, 0.05


def rows_to_keep(known: Record, case: Case) -> dict[str, int]:
    """Rows that a run goes on from: those of valves; the posterior follows from them."""
    _require_inputs(known, VALVES, len(Places(case).plan.inputs))
    return {name: known.rows(name) for name in (VALVES, SPECTRA, BEGINS)} | {POSTERIOR: 0}


def _require_inputs(known: Record, table: str, count: int) -> None:
    """Refuse a table of an earlier version, whose valves had inputs that places or the range move, too."""
    if (kept := int(known.column(table, "input").max(initial=count - 1)) + 1) != count:
        raise CaseError(
            f"The result is of an older program: its valves have {kept - count} more inputs, which places or the range "
            "move; make it anew.",
            key="identify",
        )


def check(case: Case) -> None:
    """Refuse what the case does not have, a range without the last record, a pump, a case without records, and inputs
    that places or the range take the place of.
    """
    places = Places(case)
    check_scan(case, places.parameter, *(name for one in places.of_records for name in one))
    require_head(case)
    if not case.identify.records:
        raise CaseError(
            "There is no record to identify the valve from; give RECORD.csv and --at, or identify.records.",
            key="identify.records",
        )
    if case.identify.axis is not None and places.now is not None and not places.hold_last:
        row, (first, last) = PARAMETERS[places.parameter], (places.values[0], places.values[-1])
        raise CaseError(
            f"identify.over goes from {row.amount(first)} to {row.amount(last)}, and the last record was taken at "
            f"{row.amount(places.now)}, about which onsets are sought; give a range that holds it.",
            key="identify.over",
        )
    least = len(inputs_of(case, places.plan.moved, places.plan.by)) + MORE
    if case.identify.samples < least:
        raise CaseError(
            f"identify.samples is {case.identify.samples}; with {least - MORE} uncertain inputs at least {least} are "
            "needed.",
            key="identify.samples",
        )


def run(
    session: Session, record: GrowingRecord, workers: int | str | None = None, posterior: Path | None = None
) -> None:
    """Posterior of the inputs of `uncertainty` of the case from the records of `identify`. Raises CaseError for records
    or inputs that cannot be used. Raises SolveError if the valve of the case has no steady state where a record was
    taken.

    Parameters
    ----------
    workers : int or str, optional
        See `dbvfiv.studies.workers.Workers`; those of the case by default.
    posterior : path, optional
        File for the case with what was learned as its uncertainty.
    """
    case, places = session.case, Places(session.case)
    plan, asked = places.plan, case.identify
    plan.scores_of(np.zeros((1, len(plan.inputs))))  # correlations are checked before anything is solved
    if places.now is None:
        raise CaseError(
            f"identify.over moves {places.parameter}, of which the valve of the records has no one value; give a range "
            "of another parameter.",
            key="identify.over",
        )
    lines, said = records_said(case)
    if not record.notes(_MEASURED):
        record.note(_MEASURED, lines=[asdict(line) for line in lines], records=said)
    walk = StabilityWalk(case, record, session.model)
    known = _modes_of_case(plan, places, walk, record)
    count = asked.workers if workers is None else workers
    record.begin("identify", asked.samples + (asked.rounds + 1) * asked.round + 1)
    valves = Valves(plan, places, known)
    with Workers(count, prepare_valves, (case.to_dict(), known), record.warn, valves) as team:
        search = Search(plan, places, lines, record, team)
        learning, z, rounds = search.learn()
        check = search.check(learning, z, rounds + 1)
    table = {"sample": np.repeat(np.arange(len(z)), z.shape[1]), "input": np.tile(np.arange(z.shape[1]), len(z))}
    record.extend(POSTERIOR, table | {"score": z.ravel()})
    record.note(_FOUND, rounds=rounds, left_out=[*learning.left_out], emulation=learning.emulation(z), check=check)
    result = IdentifyResult(record, session)
    record.warn(*result.doubts, *walk.about_rubbers())
    if posterior is not None:
        write_case(result.posterior_case(), posterior)


def _modes_of_case(plan: Plan, places: Places, walk: StabilityWalk, record: GrowingRecord):
    """Displacements and shapes of the modes of the case at each place; None where it has none, which is said."""
    found: list[tuple[np.ndarray, np.ndarray] | None] = []
    for number, moved in enumerate(places.moved):
        try:
            found.append(own_modes(walk, plan.point(plan.case, (), **moved)))
        except SolveError as error:
            if number in places.first:
                raise
            record.fail(f"At {places.words(number)}: {error}")
            found.append(None)
    return found


class IdentifyResult(StudyResult):
    """Inputs of a valve as measured records have them, and where flutter begins.

    Attributes
    ----------
    plan : Plan
    scores : (n, d) array
        Samples of the posterior: independent standard normal scores of the inputs.

    Examples
    --------
    >>> found = dbvfiv.load("my.toml").identify([{"file": "tap.csv", "at": "pressure=1 m"}])    # doctest: +SKIP
    >>> found.onset["above"]["interval"], found.confounded                                      # doctest: +SKIP
    """

    kind = "identify"
    missed = "{} places have no steady state"

    @cached_property
    def plan(self) -> Plan:
        return self.places.plan

    @cached_property
    def places(self) -> Places:
        return Places(self.case)

    @cached_property
    def samples(self) -> np.ndarray:
        """Scores (n, d + 2) of the posterior, with those of the common errors of the model."""
        width = len(self.plan.inputs) + 2
        _require_inputs(self.record, POSTERIOR, width)
        return self.record.column(POSTERIOR, "score").reshape(-1, width)

    @property
    def scores(self) -> np.ndarray:
        return self.samples[:, : len(self.plan.inputs)]

    @cached_property
    def learned(self) -> Learned:
        """Covariance of the inputs' scores, beside their correlation before."""
        return Learned(self.plan.scores_of(self.scores), correlation_of(self.case, self.plan.inputs))

    @cached_property
    def learning(self) -> Learning:
        """Emulated modes and measured oscillations."""
        source, score = (self.record.column(VALVES, name) for name in ("round", "score"))
        width = len(self.plan.inputs)
        _require_inputs(self.record, VALVES, width)
        count = len(score) // width
        scores, rounds = score[: count * width].reshape(count, width), source[: count * width : width]
        use = slice(None)
        found = self.record.notes(_FOUND)
        if found:  # without the valve that checks what the others say
            use = rounds <= found[-1]["rounds"]
        own = kept_modes(self.record), kept_onsets(self.record)
        learned = learned_from(self.plan, self.places, self.measured, scores[use], rounds[use], *own)
        return replace(learned, left_out=tuple(found[-1]["left_out"])) if found else learned

    @cached_property
    def measured(self) -> list[Measured]:
        """Oscillations that were measured."""
        notes = self.record.notes(_MEASURED)
        return [Measured(**line) for line in notes[-1]["lines"]] if notes else []

    @cached_property
    def inputs(self) -> list[dict[str, Any]]:
        """Knowledge of each input: median and interval before and after, share of its variance that is gone,
        variance inflation by those it is confounded with.
        """
        values, turned, found = self.plan.numbers(self.scores), self.plan.scores_of(self.scores), []
        partners = dict(self.learned.confounded())
        for i, one in enumerate(self.plan.inputs):
            low, middle, high = np.quantile(values[:, i], INTERVAL)
            before = one.distribution.at(np.array([-1.959964, 0.0, 1.959964]))
            confounded = [
                {"parameter": self.plan.inputs[j].name, "correlation": float(self.learned.correlation[i, j])}
                for j in partners.get(i, ())
            ]
            found.append(
                {
                    "parameter": one.name,
                    "median": float(middle),
                    "interval": [float(low), float(high)],
                    "prior": {"median": float(before[1]), "interval": [float(before[0]), float(before[2])]},
                    "learned": float(np.clip(1.0 - turned[:, i].var(), 0.0, 1.0)),
                    "variance_inflation": float(self.learned.inflation[i]),
                    "confounded_with": confounded,
                }
            )
        return found

    @cached_property
    def confounded(self) -> list[str]:
        """Sentences on inputs that the records do not tell apart."""
        said, seen = [], set()
        for row in self.inputs:
            for partner in row["confounded_with"][:2]:
                pair = frozenset((row["parameter"], partner["parameter"]))
                if pair not in seen:
                    seen.add(pair)
                    said.append(
                        f"{row['parameter']} and {partner['parameter']} are confounded (correlation "
                        f"{partner['correlation']:+.2f}): the records know a combination of them better than each."
                    )
        return said

    @property
    def doubts(self) -> list[str]:
        """Sentences on records that the inputs cannot explain, and on modes that are not learned well enough."""
        said = []
        middle = np.median(self.plan.scores_of(self.scores), axis=0)
        for one, score in zip(self.plan.inputs, middle):
            if abs(score) > UNLIKELY:
                said.append(
                    f"The records ask for {one.name} {abs(score):.1f} standard deviations off what was expected of it: "
                    "check the records and where they were taken, or widen uncertainty.inputs."
                )
        if (error := self.found["emulation"]) > 2.0:
            said.append(
                f"Modes between the valves computed are known to {error:.2g} times the error of the measurement only, "
                "which widens the intervals; more identify.rounds narrow them."
            )
        return said

    @cached_property
    def values(self) -> np.ndarray:
        """Values (k,) of the range over which damping is known, SI."""
        return self.learning.values

    @cached_property
    def damping(self) -> np.ndarray | None:
        """Least damping ratio (n, k) of samples over `values`; None where too few valves are known."""
        return self.learning.damping_over_range(self.samples, self.case.identify.seed)

    @cached_property
    def _onsets(self) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        if self.damping is None:
            return None
        return self.learning.onsets(self.samples, self.damping, self.case.identify.seed)

    @cached_property
    def onset(self) -> dict[str, Any] | None:
        """Onset of flutter below and above the last record, of samples that are stable there, and under ``ends`` its
        end, of those that flutter: median, 95 % interval (None beyond the range) and the probability, among all, that
        there is one within the range, of which ``range`` are the ends; None where too few valves are known.
        """
        if self._onsets is None:
            return None
        below, above, present = self._onsets
        found: dict[str, Any] = {"parameter": self.places.parameter, "now": self.places.now}
        found["range"] = [float(self.values[0]), float(self.values[-1])]
        found |= {"flutters_now": float(np.mean(present < 0)), "ends": {}}
        for kept, among in ((found, present >= 0), (found["ends"], present < 0)):
            for name, at, beyond in (("below", below, -np.inf), ("above", above, np.inf)):
                kept[name] = _interval(at, among, beyond)
        return found

    @cached_property
    def further(self) -> list[dict[str, Any]]:
        """Best further measurement for each confounded input, and for the onset or the end of flutter: where, of which
        mode, and the share of the standard deviation expected to remain.
        """
        targets = {self.plan.inputs[i].name: self.learned.scores[:, i] for i, _ in self.learned.confounded()}
        if self._onsets is not None:
            *sides, present = self._onsets
            for word, among in (("onset", present >= 0), ("end", present < 0)):
                for side, at in zip(("below", "above"), sides):
                    here = np.where(among, at, np.nan)
                    if np.isfinite(here).mean() > 0.5:
                        targets[f"{word} {side}"] = here
        return self.learning.further(self.samples, targets)

    @cached_property
    def matches(self) -> list[dict[str, Any]]:
        """Modes that each measured oscillation may be: frequency at the posterior median, and probability."""
        found = []
        points = coordinates(self.plan, self.scores)
        for line, share in zip(self.measured, self.learning.matches(self.samples)):
            place = self.places.of_line(line)
            frequency, damping = self.learning.modal(place).at(points)
            likely = [
                {
                    "frequency": float(np.median(frequency[:, mode])),
                    "damping_ratio": float(np.median(damping[:, mode])),
                    "probability": float(share[mode]),
                }
                for mode in np.argsort(-share[:-1])
                if share[mode] >= 0.01
            ]
            own = {"record": line.record, "frequency": line.frequency, "damping_ratio": json_value(line.damping_ratio)}
            found.append(own | {"place": self.places.words(place), "modes": likely, "none": float(share[-1])})
        return found

    def uncertainty(self) -> tuple[dict[str, str], list[tuple[str, str, float]]]:
        """Distributions of the inputs and correlations of their normal scores, as `uncertainty` takes them."""
        turned, texts = self.plan.scores_of(self.scores), {}
        ranks = np.argsort(np.argsort(turned, axis=0), axis=0)
        normal = ndtri((ranks + 0.5) / len(turned))
        for i, one in enumerate(self.plan.inputs):
            texts[one.name] = distribution_text(one.distribution, turned[:, i], one.limits)
        matrix, names = np.corrcoef(normal.T).reshape(len(texts), -1), list(texts)
        matrix[np.abs(matrix) < KEPT] = 0.0
        np.fill_diagonal(matrix, 1.0)
        others = ~np.eye(len(matrix), dtype=bool)
        while np.linalg.eigvalsh(np.round(matrix, 4))[0] < 1e-4:  # left-out ones may make it impossible
            matrix[others] *= 0.99
        pairs = [(names[i], names[j], round(float(matrix[i, j]), 4)) for i in range(len(names)) for j in range(i)]
        return texts, [pair for pair in pairs if pair[2]]

    def posterior_case(self) -> Case:
        """The case with what was learned as its uncertainty, without a range over one of its inputs."""
        (texts, pairs), axis = self.uncertainty(), self.case.uncertainty.axis
        if not self.case.uncertainty.inputs:  # what the records do not tell of stays as uncertain as it was
            shipped = inputs_of(self.case.replace({"uncertainty.over": None}))
            texts = {one.name: one.distribution.words(one.quantity) for one in shipped} | texts
        keys = {"uncertainty.over": None} if axis is not None and axis.parameter in texts else {}
        return self.case.replace(keys | {"uncertainty.inputs": texts, "uncertainty.correlation": pairs})

    @property
    def found(self) -> dict[str, Any]:
        """Rounds, error of the emulated modes over the measurement's, and the likeliest valve by the full model."""
        notes = self.record.notes(_FOUND)
        return {k: v for k, v in notes[-1].items() if k != "what"} if notes else {}

    def summary(self) -> dict[str, Any]:
        if not self.found:
            return {"inputs": [], "matches": [], "onset": None, "further": []} | self.ending()
        texts, pairs = self.uncertainty()
        return {
            "symmetry": equilibria_of(self.case.part).name,
            "records": self.record.notes(_MEASURED)[-1]["records"],
            "matches": self.matches,
            "inputs": self.inputs,
            "confounded": self.confounded,
            "directions": [
                {"remaining": size, "of": {o.name: float(c) for o, c in zip(self.plan.inputs, vector)}}
                for size, vector in self.learned.directions()
            ],
            "onset": self.onset,
            "further": self.further,
            "check": self.found,
            "uncertainty": {"inputs": texts, "correlation": pairs},
            "valves": int(self.record.column(VALVES, "sample").max(initial=-1)) + 1,
        } | self.ending()

    def lines(self) -> list[str]:
        if not self.found:
            return ["Too few valves were computed to learn from."]
        said = [f"At {describe_fixed(self.case, *(one.name for one in self.plan.inputs))}:"]
        for row in self.record.notes(_MEASURED)[-1]["records"]:
            said.append(f"  record {row['record'] + 1} {row['file']}: {row['says']}, modes measured: {row['modes']}")
        own = only_class_of(self.case.part)
        said.append(f"Modes are of {own}; a line of another motion is taken for one of these, or left out:")
        for match in self.matches:
            said.append(f"  {_oscillation(match)} at {match['place']} is {_modes_said(match)}")
        said += ["", f"{'input':<34}{'before (95 %)':>28}{'after (95 %)':>28}{'learned':>9}"]
        for row, one in zip(self.inputs, self.plan.inputs):
            before, after = (
                f"{d['median']:.4g} ({d['interval'][0]:.4g} to {d['interval'][1]:.4g})" for d in (row["prior"], row)
            )
            unit = f", {one.quantity.si}" if one.quantity.si else ""
            said.append(f"{row['parameter'] + unit:<34}{before:>28}{after:>28}{100 * row['learned']:>8.0f}%")
        said += ["", *self.confounded, *map(self._further_said, self.further)]
        check = [
            f"{mode['full'][0]:.5g} Hz, {100 * mode['full'][1]:.3g} % ({mode['emulated'][0]:.5g} Hz, "
            f"{100 * mode['emulated'][1]:.3g} %)"
            for mode in self.found["check"]["modes"]
        ]
        said.append(f"The likeliest valve by the full model, and as learned from: {'; '.join(check)}.")
        return [*said, "", *self._onset_said()]

    def _value(self, value: float) -> str:
        row = PARAMETERS[self.places.parameter]
        return f"{row.amount(float(f'{value:.4g}'))}{self.places.head(row.name, value)}"

    def _further_said(self, row: dict[str, Any]) -> str:
        where = f"the mode near {digits(row['frequency'])} Hz at {self._value(row['value'])}"
        if row["remaining"] > 0.9:
            return f"No further record over the range would tell much of {row['target']}; measure it by itself."
        return f"A record of {where} would leave {100 * row['remaining']:.0f} % of what is open of {row['target']}."

    def _onset_said(self) -> list[str]:
        if self.onset is None:
            return ["Where flutter begins is not known: too few valves have modes over the range."]
        said, found = [], self.onset
        flutters = found["flutters_now"]
        if flutters > RARE:
            said.append(f"It flutters at the last record with a probability of {100 * flutters:.0f} %.")
        if len(self.values) < len(self.places.values):
            low, high = map(self._value, found["range"])
            said.append(f"Damping is known from {low} to {high}: too few valves have modes at all values beyond.")
        for verb, parts, share in (("begins", found, 1 - flutters), ("ends", found["ends"], flutters)):
            said += [self._side_said(name, verb, parts[name]) for name in ("above", "below") if share > RARE]
        return said

    def _side_said(self, name: str, verb: str, part: dict[str, Any]) -> str:
        """Sentence on where flutter begins or ends on one side of the last record."""
        end = self._value(self.values[-1 if name == "above" else 0])
        if part["probability"] < RARE:
            return f"Flutter {verb} nowhere {name} {self._value(self.places.now)} up to {end}."
        low, middle, high = (
            f"beyond {end}" if v is None else self._value(v)
            for v in (part["interval"][0], part["median"], part["interval"][1])
        )
        return f"{name.capitalize()} the last record flutter {verb} at {middle} (95 %: {low} to {high})."


def _interval(at: np.ndarray, among: np.ndarray, beyond: float) -> dict[str, Any]:
    """Median and interval of values (n,) of some of the samples, NaN being `beyond` the range, and the share of all
    samples that are some of these and have one.
    """
    whole = np.where(np.isfinite(at), at, beyond)[among]
    found = np.quantile(whole, INTERVAL, method="nearest") if whole.size else np.full(3, beyond)
    low, middle, high = json_value(found)
    return {"median": middle, "interval": [low, high], "probability": float((np.isfinite(at) & among).mean())}


def _oscillation(match: dict[str, Any]) -> str:
    ratio = match["damping_ratio"]
    return f"{match['frequency']:.5g} Hz" + ("" if ratio is None else f" with {100 * ratio:.3g} % damping")


def _modes_said(match: dict[str, Any]) -> str:
    if match["none"] > 0.5:
        return "none of the modes computed, and left out"
    said = [f"the mode at {m['frequency']:.4g} Hz, {100 * m['damping_ratio']:.3g} %" for m in match["modes"][:4]]
    if len(said) == 1:
        return said[0]
    shares = [f"{said} ({100 * mode['probability']:.0f} %)" for said, mode in zip(said, match["modes"])]
    return f"a mixture: {' or '.join(shares)}"


def distribution_text(prior: Distribution, scores: np.ndarray, limits: tuple[float, float] = (-np.inf, np.inf)) -> str:
    """Text of the distribution whose scores under the prior are samples (n,), of a number between limits."""
    from scipy.stats import kstest

    mean, spread = float(scores.mean()), float(scores.std())
    a, b = prior.numbers[0], prior.numbers[-1]
    if prior.form in ("normal", "lognormal") and kstest((scores - mean) / spread, "norm").statistic < FORM:
        is_normal = prior.form == "normal"
        numbers = (a + b * mean, b * spread) if is_normal else (a * b**mean, b**spread)
        wide = is_normal or numbers[1] > 1.0 + 1e-6
        if wide and Distribution(prior.form, numbers).share_outside(*limits) <= 0.5 * ALLOWED:  # of rounded numbers too
            return f"{prior.form}({numbers[0]:.8g}, {numbers[1]:.{6 if is_normal else 8}g})"
    steps = prior.at(np.quantile(scores, (np.arange(STEPS) + 0.5) / STEPS))
    values = [f"{value:.8g}" for value in steps]
    if values[0] == values[-1]:  # one of the samples of the prior: a distribution has some width
        narrow = f"lognormal({values[0]}, {1 + NARROW})", f"normal({values[0]}, {NARROW * prior.scale:.6g})"
        return narrow[0 if steps[0] > 0 else 1]
    return f"samples({', '.join(values)})"


def draw(result: StudyResult) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of an identification, each with its name."""
    if not result.found:
        return
    yield "inputs", lambda: inputs(result)
    if result.onset is not None:
        yield "onset", lambda: onset(result)


def inputs(result: StudyResult) -> Figure:
    """Intervals of the inputs over those of the prior, and their correlations."""
    figure = new_figure(10.4, 0.4 * len(result.inputs) + 2.6)
    left, right = figure.subplots(1, 2, width_ratios=(1.3, 1.0))
    scores = result.plan.scores_of(result.scores)
    titles = [f"{number}  {one.title}" for number, one in enumerate(result.plan.inputs, 1)]
    low, middle, high = np.quantile(scores, (0.025, 0.5, 0.975), axis=0)
    rows = np.arange(len(titles))
    left.hlines(rows, -1.96, 1.96, color=REST, lw=7, alpha=0.4, label="before, 95 %")
    left.hlines(rows, low, high, color=COMPUTED, lw=3, label="after, 95 %")
    left.plot(middle, rows, "o", color=ACCENT, label="median")
    left.set_yticks(rows, titles)
    left.set(xlabel="Standard deviations of the prior", ylim=(len(rows) - 0.5, -0.5))
    left.legend(loc="upper center", bbox_to_anchor=(0.5, -0.18), ncols=3)
    shown = right.imshow(np.corrcoef(scores.T).reshape(len(rows), -1), vmin=-1, vmax=1, cmap="RdBu_r")
    right.set_xticks(rows, [str(row + 1) for row in rows])
    right.set_yticks(rows, [str(row + 1) for row in rows])
    right.grid(False)
    figure.colorbar(shown, ax=right, label="Correlation after")
    return headline(figure, f"What the records say of {result.header.name}")


def onset(result: StudyResult) -> Figure:
    """Least damping ratio over the range with its interval, and where the records were taken."""
    figure = new_figure()
    axes = figure.add_subplot()
    name, damping = result.places.parameter, result.damping
    x = result.values / PARAMETERS[name].scale
    low, middle, high = 100 * np.quantile(damping, (0.025, 0.5, 0.975), axis=0)
    axes.fill_between(x, low, high, color=COMPUTED, alpha=0.25, lw=0, label="95 %")
    axes.plot(x, middle, "o-", color=COMPUTED, label="median")
    axes.axhline(0.0, color="black", lw=0.8)
    for words, side in product(("onset", "end"), ("below", "above")):
        part = result.onset[side] if words == "onset" else result.onset["ends"][side]
        ends = [value for value in part["interval"] if value is not None]
        if len(ends) == 2:  # found by itself: between the values of the range damping is not straight
            span = np.array(ends) / PARAMETERS[name].scale
            axes.axvspan(*span, color=REST, alpha=0.5, label=f"{words} {side}, 95 %")
    for number, match in enumerate(result.matches):
        value = result.places.value_at(match["record"]) / PARAMETERS[name].scale
        if match["damping_ratio"] is not None:
            label = "measured" if number == 0 else None
            axes.plot(value, 100 * match["damping_ratio"], "s", color=ACCENT, label=label)
    axes.set(xlabel=parameter_label(result.case, name), ylabel="Least damping ratio, %")
    axes.legend()
    return headline(figure, f"Damping of {result.header.name} by its records")


STUDY = Study(
    "identify", lambda _mesh: TABLES, run, IdentifyResult, check, rows_to_keep=rows_to_keep, files={"posterior": ""}
)
