"""Probability of flutter and what decides it: run, storage, and what can be read off a run or its file."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, partial
from typing import Any

import numpy as np

from ...case.parameters import PARAMETERS, Mu
from ...errors import CaseError, SolveError
from ...model.symmetry import equilibria_of, only_class_of
from ...record.record import GrowingRecord, Record
from ...record.table import Column, TableSpec
from ...texts import digits, json_value
from ..case import Case
from ..inputs import CONFIDENCE, Plan, Probability, counted, parameter_of, quasi_random
from ..result import RangeResult
from ..session import Session, Study
from ..stability.dimensions import flow_models
from ..stability.neighbours import CHECKS, NEAR_SEED, TAKEN, Neighbours, find_neighbours
from ..stability.place import check_scan, describe_fixed, fixed_conditions
from ..stability.verdict import DIVERGES, FLUTTERS, NOT_VALID, OUTCOMES, STABLE, UNDECIDED
from ..stability.walk import StabilityWalk
from ..workers import Lost, Work, Workers, require_answer, share_samples
from .sampling import Found, Sampler, Shifted, Start, approach, shares, subset, weighted

SAMPLES, NUMBERS = "samples", "numbers"
#: Notes: reason of an undecided sample; error of the space that samples share at a value of the range; a sample found
#: with its full matrices although there is such a space.
_WHY, _SPACE, _APART = "undecided sample", "shared space", "sample apart"
_LAW = Column("continuity", "", "Blend of the flow models, 0 quasi-steady, 1 storage")
_SAMPLES = (
    _LAW,
    Column("sample", "", "Number of the sample", "i8"),
    Column("value", "SI", "Of the range"),
    Column("outcome", "", f"Verdict: {', '.join(f'{i} {name}' for i, name in enumerate(OUTCOMES))}", "i8"),
    Column("growth_rate", "1/s", "Of the leading oscillating mode"),
    Column("frequency", "Hz", "Of that mode"),
    Column("damping_ratio", "", "Of the least damped oscillating mode"),
    Column("opening", "m^2", "Area between the lips"),
    Column("flow", "m^3/s", "Volume flow; 0 of a bill that is moulded shut and sealed"),
)
_NUMBERS = (
    _LAW,
    Column("sample", "", "Number of the sample", "i8"),
    Column("input", "", "Number of the input", "i8"),
    Column("value", "SI", "Of the input"),
    Column("score", "", "Standard normal score of the input, correlated"),
    Column("log_weight", "", "Logarithm of the weight of the sample"),
    Column("stage", "", "0 of samples of the inputs as they are, then the step towards a rare event", "i8"),
)
#: Verdicts on the samples, and their inputs.
_TABLES = TableSpec(SAMPLES, _SAMPLES, chunk=512), TableSpec(NUMBERS, _NUMBERS, chunk=512)
#: Samples that a worker takes at a time: of valves that share their states, and of valves with their own.
SHARED, OWN = 64, 4
#: What a bill that is moulded shut may be besides the outcome of its verdict.
NOT_SEALED = "not sealed"
#: Samples from which a space that they share pays.
PAYS = 48
#: Samples of the final density of a rare event over all that may be used; the others lead there.
FINAL = 0.4
#: Quantities whose percentiles are told.
_SPREADS = ("damping_ratio", "frequency", "opening", "flow")


def rows_to_keep(known: Record, _case: Case) -> dict[str, int]:
    """Rows that a run goes on from: verdicts, and the inputs of the samples that have them."""
    vouched, inputs = (set(zip(*(known.column(name, c) for c in (_LAW.name, "sample")))) for name in (SAMPLES, NUMBERS))
    each = known.rows(NUMBERS) // max(len(inputs), 1)
    return {SAMPLES: known.rows(SAMPLES), NUMBERS: each * len(vouched)}


def check(case: Case) -> None:
    """Refuse a range of what the case does not have, samples of the head behind a pump, and methods with a range."""
    plan = Plan(case)
    check_scan(case, plan.parameter)
    flow_models(case, "uncertainty")
    if case.has_pump and "pressure" in map(parameter_of, case.uncertainty.inputs):
        raise CaseError(
            "uncertainty.inputs holds the pressure, and behind a pump each sampled valve has that at which both meet; "
            "leave it out, or the pump.",
            key="uncertainty.inputs",
        )
    if case.uncertainty.method != "plain" and len(plan.values) > 1:
        raise CaseError(
            f"uncertainty.method is {case.uncertainty.method!r} with {len(plan.values)} values of {plan.parameter}, "
            "and samples are drawn towards the flutter of one state; leave uncertainty.over out, or method.",
            key="uncertainty.method",
        )


def run(session: Session, record: GrowingRecord, workers: int | str | None = None) -> None:
    """Samples of the inputs of `uncertainty` of the case, and the verdict on each at every value of its range. Raises
    CaseError for inputs that cannot be used. Raises SolveError if the valve of the case has no steady state at any
    value.

    Parameters
    ----------
    workers : int or str, optional
        See `dbvfiv.studies.workers.Workers`; those of the case by default.
    """
    case, plan, laws = session.case, Plan(session.case), flow_models(session.case, "uncertainty")
    count = case.uncertainty.workers if workers is None else workers
    require_answer(count)
    plan.scores_of(np.zeros((1, len(plan.inputs))))  # correlations are checked before anything is solved
    for one in plan.inputs:
        record.progress(one.words())
    record.begin("uncertainty", len(laws) * case.uncertainty.samples)
    _sample(plan, StabilityWalk(case, record, session.model), record, count)
    for law in laws[1:]:
        record.progress(f"the same under {law}")
        other = Plan(_under(case, law))
        _sample(other, StabilityWalk(other.case, record), record, count)


def _under(case: Case, law: str) -> Case:
    """The case under another flow model."""
    return case.replace({"fluid.continuity": law, "uncertainty.continuity": "case"})


def _sample(plan: Plan, walk: StabilityWalk, record: GrowingRecord, count: int | str) -> None:
    """Samples of a plan under the flow model of its case; `walk` is of that."""
    case, states = plan.case, _states_of_case(plan, walk, record)
    with Workers(count, _start, (case.to_dict(), states), record.warn) as team:
        neighbours = _neighbours(plan, states, record, team)
        team.give(_start, case.to_dict(), states, neighbours, here=Sampler(plan, states, neighbours, walk))
        sampling = _Sampling(plan, record, team)
        if case.uncertainty.method == "rare":
            sampling.rare()
        elif case.uncertainty.method == "subset":
            sampling.subset()
        else:
            independent = quasi_random(case.uncertainty.samples, len(plan.inputs), case.uncertainty.seed)
            sampling.verdicts(independent, np.zeros(len(independent)), 0)


def _states_of_case(plan: Plan, walk: StabilityWalk, record: GrowingRecord) -> list[Start | None]:
    """Steady states of the case itself at the values of the range; what has none is said."""
    own = Mu.of(plan.case)
    lift = 0.0 if plan.parameter == "pressure" else walk.lift(own)
    states: list[Start | None] = []
    for value in plan.values:
        try:
            place = own.at(**{plan.parameter: value})
            lift = walk.lift(place) if plan.parameter == "pressure" else lift
            states.append(Start(walk.equilibrium(walk.meet_pump(place, lift)), lift))
        except SolveError as error:
            record.fail(str(error))
            states.append(None)
    if all(state is None for state in states):
        raise SolveError(f"The valve of the case has no steady state: {record.failures[0]}")
    record.warn(*walk.about_rubbers())
    return states


def _neighbours(plan: Plan, states: list[Start | None], record: GrowingRecord, team: Workers) -> dict[int, Neighbours]:
    """Neighbours of the case at each value, whose space samples share, where that pays and can be had."""
    found: dict[int, Neighbours] = {}
    if plan.is_surrounding or plan.case.uncertainty.samples < PAYS:
        return found
    row, d = PARAMETERS[plan.parameter], len(plan.inputs)
    origin, ahead = plan.numbers(np.zeros((1, d)))[0], np.array([one.distribution.scale for one in plan.inputs])
    near, sampler = plan.numbers(quasi_random(TAKEN + CHECKS, d, NEAR_SEED)), Sampler(plan, states)

    def shared(i: int, function: Callable[..., Any], beside: Neighbours, rows: Sequence[np.ndarray]) -> list:
        team.give(_start_beside, plan.case.to_dict(), states, i, beside, here=(sampler, i, beside))
        found = dict(team.share(range(len(rows)), lambda k: Work(_beside, (function, rows[k]))))
        if any(value is Lost for value in found.values()):
            raise SolveError(Lost.sentence)
        return [found[k] for k in range(len(rows))]

    for i, (value, state) in enumerate(zip(plan.values, states)):
        if state is None:
            continue
        where = row.amount(value, 4)
        record.progress(f"space that samples share at {where}, of {3 + len(near)} valves")
        try:
            valves = origin, ahead, state.q, near[:TAKEN], near[TAKEN:], plan.numbers
            found[i] = find_neighbours(sampler.walks(i), *valves, partial(shared, i))
            record.note(_SPACE, law=plan.law, value=value, error=found[i].error)
        except (SolveError, CaseError, ArithmeticError, ValueError) as error:
            record.progress(f"each sample is found by itself at {where}: {error}")
    return found


def _start_beside(case: dict, states: list[Start | None], i: int, beside: Neighbours) -> tuple:
    return _start(case, states), i, beside


def _beside(context: tuple, function: Callable[..., Any], row: np.ndarray) -> Any:
    """A function of the valves at a value of the range, of neighbours and of numbers."""
    sampler, i, beside = context
    return function(sampler.walks(i), beside, row)


def _start(case: dict, states: list[Start | None], neighbours: Mapping[int, Neighbours] = {}) -> Sampler:
    return Sampler(Plan(Case.from_dict(case)), states, neighbours)


def _performance(outcome: int, damping_ratio: float) -> float:
    """Distance of a sample beyond flutter; NaN where nothing is known of it, minus infinity where it diverges."""
    return {FLUTTERS: -damping_ratio, STABLE: -damping_ratio, DIVERGES: -np.inf}.get(OUTCOMES[outcome], np.nan)


def _are(found: dict[str, np.ndarray], outcome: str) -> np.ndarray:
    """True for samples of an outcome, and for those that flow passes, of a bill that is moulded shut."""
    if outcome == NOT_SEALED:
        return found["flow"] > 0
    return found["outcome"] == OUTCOMES.index(outcome)


def _unknown(found: dict[str, np.ndarray], outcome: str) -> np.ndarray:
    """True for samples of which nothing tells whether they are of an outcome: without a verdict, or with a rubber whose
    constants do not hold, which is no evidence of stability.
    """
    if outcome == NOT_SEALED:
        return np.isnan(found["flow"])
    return _are(found, UNDECIDED) | (_are(found, NOT_VALID) & (outcome != NOT_VALID))


class _Sampling:
    """Samples found so far, and those still wanted; what an earlier attempt kept is not computed again."""

    def __init__(self, plan: Plan, record: GrowingRecord, team: Workers):
        self.plan, self.record, self.team = plan, record, team
        self.asked = 0
        known = [row for row in record.table_rows(_TABLES[0]) if row["continuity"] == plan.law]
        counts = np.bincount([row["sample"] for row in known], minlength=1) if known else np.zeros(1, int)
        self.known = {
            row["sample"]: _performance(row["outcome"], row["damping_ratio"])
            for row in known
            if counts[row["sample"]] == len(plan.values)
        }

    def verdicts(self, independent: np.ndarray, log_weight: np.ndarray, stage: int) -> np.ndarray:
        """Performance (m,) of samples, the least damping ratio with its sign turned, at the last value of the range."""
        plan, first = self.plan, self.asked
        self.asked += len(independent)
        numbers, scores = plan.numbers(independent), plan.scores_of(independent)
        size = SHARED if plan.is_surrounding else OWN
        wanted = lambda sample: sample not in self.known  # noqa: E731
        for start, rows in share_samples(self.team, "Samples", Work(Sampler.found), numbers, first, size, wanted):
            block = slice(start, start + size)
            self._keep(first + start, rows, numbers[block], scores[block], log_weight[block], stage)
        return np.array([self.known[first + k] for k in range(len(independent))])

    def _keep(self, first: int, rows: list[Found], numbers, scores, log_weight, stage: int) -> None:
        """Keep whole samples: their inputs before their verdicts, which vouch for them."""
        fresh = [row for row in rows if row.sample not in self.known]
        new = sorted({row.sample for row in fresh})
        inputs = [
            (self.plan.law, sample, i, numbers[k, i], scores[k, i], log_weight[k], stage)
            for sample, k in ((sample, sample - first) for sample in new)
            for i in range(numbers.shape[1])
        ]
        self.record.extend(NUMBERS, dict(zip((c.name for c in _NUMBERS), map(list, zip(*inputs)))))
        for row in fresh:
            if row.why:
                self.record.note(_WHY, law=self.plan.law, sample=row.sample, value=row.value, reason=row.why)
            if row.apart:
                self.record.note(_APART, law=self.plan.law, sample=row.sample, value=row.value)
        found = {column.name: [getattr(row, column.name) for row in fresh] for column in _SAMPLES[1:]}
        self.record.extend(SAMPLES, {_LAW.name: [self.plan.law] * len(fresh)} | found)
        for row in fresh:
            self.known[row.sample] = _performance(row.outcome, row.damping_ratio)
        for sample in new:
            self.record.item(sample)

    def _stages(self) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
        """Function from scores and the logarithm of their weights to performances, one stage after another."""
        stages = itertools.count()

        def evaluate(scores: np.ndarray, log_weight: np.ndarray) -> np.ndarray:
            stage = next(stages)
            self.record.progress(f"step {stage} towards flutter, {len(scores)} samples")
            return self.verdicts(scores, log_weight, stage)

        return evaluate

    def rare(self) -> None:
        """Samples about a rare flutter: steps towards it, then those of its final density."""
        asked, evaluate = self.plan.case.uncertainty, self._stages()
        each = max(32, round((1 - FINAL) * asked.samples / 5))
        density: Shifted = approach(evaluate, len(self.plan.inputs), each, asked.seed)
        scores = density.draw(max(32, round(FINAL * asked.samples)), np.random.default_rng([asked.seed, 1]))
        evaluate(scores, density.log_weight(scores))

    def subset(self) -> None:
        """Samples of levels towards a rare flutter."""
        asked = self.plan.case.uncertainty
        subset(self._stages(), len(self.plan.inputs), asked.samples, asked.seed)


class UncertaintyResult(RangeResult):
    """Probability of each outcome over a range, and what decides it.

    Attributes
    ----------
    parameter : str
    points : list of dict
        One for each value of the range, see `point`.

    Examples
    --------
    >>> found = dbvfiv.load("cases/dbv12-in-line.toml").uncertainty("pressure=0.5 m:4 m:3")     # doctest: +SKIP
    >>> [(point["value"], point["probability"], point["interval"]) for point in found.points]   # doctest: +SKIP
    """

    kind = "uncertainty"
    #: Flow model in place of that of the case.
    _law: str | None = None

    @cached_property
    def case(self) -> Case:
        return self.header.case if self._law is None else _under(self.header.case, self._law)

    @cached_property
    def other_law(self) -> tuple[str, UncertaintyResult] | None:
        """The other flow model with its samples, where both were asked for."""
        laws = flow_models(self.case, self.kind)
        if len(laws) == 1:
            return None
        other = type(self)(self.record)
        other._law = laws[1]
        return laws[1], other

    @cached_property
    def plan(self) -> Plan:
        return Plan(self.case)

    def _columns(self, table: str, columns: Sequence[Column]) -> dict[str, np.ndarray]:
        mine = self.record.column(table, _LAW.name) == self.plan.law
        return {column.name: self.record.column(table, column.name)[mine] for column in columns}

    @cached_property
    def _rows(self) -> dict[str, np.ndarray]:
        return self._columns(SAMPLES, _SAMPLES)

    @cached_property
    def _inputs(self) -> dict[str, np.ndarray]:
        """Values and scores (samples, d), weights and stages (samples,), by the number of the sample."""
        kept = self._columns(NUMBERS, _NUMBERS)
        count, width = int(kept["sample"].max(initial=-1)) + 1, len(self.plan.inputs)
        values, scores = np.full((count, width), np.nan), np.full((count, width), np.nan)
        values[kept["sample"], kept["input"]], scores[kept["sample"], kept["input"]] = kept["value"], kept["score"]
        weights, stages = np.zeros(count), np.zeros(count, int)
        weights[kept["sample"]], stages[kept["sample"]] = np.exp(kept["log_weight"]), kept["stage"]
        return {"values": values, "scores": scores, "weights": weights, "stages": stages}

    def at(self, value: float) -> dict[str, np.ndarray]:
        """Samples at one value of the range in their order: the columns of the table, with ``inputs`` and ``scores``
        (n, d), ``weight`` and ``stage``.
        """
        rows, inputs = self._rows, self._inputs
        here = np.flatnonzero(rows["value"] == value)
        here = here[np.argsort(rows["sample"][here])]
        number = rows["sample"][here]
        found = {name: column[here] for name, column in rows.items()}
        own = {"inputs": inputs["values"], "scores": inputs["scores"], "weight": inputs["weights"]}
        return found | {name: table[number] for name, table in own.items()} | {"stage": inputs["stages"][number]}

    def probability(self, value: float, outcome: str = FLUTTERS) -> Probability:
        """Probability of an outcome at a value of the range."""
        found, method = self.at(value), self.case.uncertainty.method
        hits, undecided = _are(found, outcome), _unknown(found, outcome)
        if method == "plain":
            return counted(int(hits.sum()), int(undecided.sum()), len(hits))
        if method == "subset":
            return self._by_levels(found) if outcome == FLUTTERS and self.complete else Probability(np.nan, 0.0, 1.0)
        last = found["stage"] == found["stage"].max(initial=0)
        return weighted(found["weight"][last], hits[last], undecided[last])

    def _by_levels(self, found: dict[str, np.ndarray]) -> Probability:
        """Probability of flutter by subset sampling, which asks for the kept samples in their order."""
        values = iter(map(_performance, found["outcome"], found["damping_ratio"]))
        asked = self.case.uncertainty

        def evaluate(scores: np.ndarray, _log_level: np.ndarray) -> np.ndarray:
            return np.array([next(values) for _ in scores])

        return subset(evaluate, len(self.plan.inputs), asked.samples, asked.seed)

    def point(self, value: float) -> dict[str, Any]:
        """Numbers at a value of the range: ``probability`` of flutter among the decided samples with its ``interval``
        (those that are not valid are not decided), ``samples``, ``undecided``, ``shared`` (decided on the space that
        samples share), ``outcomes`` by their names (with ``not sealed`` of a bill that is moulded shut),
        ``percentiles`` (2.5, 50, 97.5) and ``decides``.
        """
        found, outcomes = self.at(value), {}
        for name in (FLUTTERS, DIVERGES, NOT_VALID, STABLE, *((NOT_SEALED,) if self.case.valve.is_preset else ())):
            one = self.probability(value, name)
            outcomes[name] = {"probability": json_value(one.value), "interval": [one.low, one.high]}
        plain = found["stage"] == 0
        spreads = {name: _percentiles(found[name][plain]) for name in _SPREADS}
        return {
            "value": float(value),
            **outcomes[FLUTTERS],
            "samples": len(found["outcome"]),
            "undecided": int(_are(found, UNDECIDED).sum()),
            "shared": self._shared(value, found["sample"]),
            "outcomes": outcomes,
            "percentiles": spreads,
            "decides": self.decides(value),
        }

    def _shared(self, value: float, samples: np.ndarray) -> int:
        here = self.plan.law, value
        if not any((note["law"], note["value"]) == here for note in self.record.notes(_SPACE)):
            return 0
        apart = {note["sample"] for note in self.record.notes(_APART) if (note["law"], note["value"]) == here}
        return len(set(samples.tolist()) - apart)

    def decides(self, value: float) -> list[dict[str, Any]]:
        """Share of each input in the variance of the least damping ratio at a value, and in that of flutter or not,
        the largest first; None where there are too few samples or nothing varies.
        """
        found = self.at(value)
        plain = (found["stage"] == 0) & ~_unknown(found, FLUTTERS)
        scores = found["scores"][plain]
        margin = shares(scores, found["damping_ratio"][plain])
        outcome = shares(scores, _are(found, FLUTTERS)[plain].astype(float))
        rows = [
            {"parameter": one.name, "share": json_value(m), "share_of_outcome": json_value(o)}
            for one, m, o in zip(self.plan.inputs, margin, outcome)
        ]
        return sorted(rows, key=lambda row: -(row["share"] or 0.0))

    def measured(self, value: float, name: str, accuracy: float) -> tuple[Any, Any] | None:
        """Percentiles of the least damping ratio at a value now, and if an input were measured to an accuracy (0.1 for
        10 % at 95 %) and had its median; None where too few samples lie there, as about a median of 0.
        """
        found, number = self.at(value), [one.name for one in self.plan.inputs].index(name)
        plain = (found["stage"] == 0) & np.isfinite(found["damping_ratio"])
        own = self.plan.inputs[number].distribution
        if not own.median:
            return None
        apart = (found["inputs"][plain, number] - own.median) / (accuracy * abs(own.median) / 1.96)
        log = -0.5 * apart**2  # likelihood of the measurement: what is known of the input besides stays
        weights = np.exp(log - log.max(initial=-np.inf))
        if not len(weights) or weights.sum() ** 2 / (weights**2).sum() < _ENOUGH:
            return None
        ratio = found["damping_ratio"][plain]
        return _percentiles(ratio), _percentiles(ratio, weights)

    @cached_property
    def others(self) -> tuple[str, ...]:
        """Outcomes besides flutter that are told at each value: "diverges" where any sample does, and "not valid"."""
        diverges = (self.record.column(SAMPLES, "outcome") == OUTCOMES.index(DIVERGES)).any()
        return (DIVERGES,) * bool(diverges) + (NOT_VALID,)

    @cached_property
    def points(self) -> list[dict[str, Any]]:
        there = set(self._rows["value"].tolist())
        return [self.point(value) for value in self.plan.values if value in there]

    @property
    def deciding(self) -> dict[str, Any] | None:
        """Point whose outcome is least certain: what decides there is what decides."""
        known = [point for point in self.points if point["probability"] is not None]
        return max(known, key=lambda p: p["probability"] * (1 - p["probability"]), default=None)

    def summary(self) -> dict[str, Any]:
        deciding, both = self.deciding, {}
        if self.other_law:
            law, other = self.other_law
            both = {"other_law": {"continuity": law, "points": other.points}}
            both |= {"comparison": self.comparison} if self.case.uncertainty.method == "plain" else {}
        return {
            "parameter": self.parameter,
            "symmetry": equilibria_of(self.case.part).name,
            "points": self.points,
            "decides": [] if deciding is None else deciding["decides"],
            "inputs": [one.summary() for one in self.plan.inputs],
            "method": self.case.uncertainty.method,
            "confidence": CONFIDENCE,
            "fixed": fixed_conditions(self.case, self.parameter, *(one.name for one in self.plan.inputs)),
        } | (both | self.ending())

    @property
    def comparison(self) -> str:
        """Sentence on how many of the same samples have the same outcome under both flow models."""
        law, other = self.other_law
        same = count = 0
        for value in self.plan.values:
            one, two = self.at(value), other.at(value)
            both, first, second = np.intersect1d(one["sample"], two["sample"], return_indices=True)
            same += int((one["outcome"][first] == two["outcome"][second]).sum())
            count += len(both)
        return f"Under {law} {same} of {count} samples have the outcome of {self.case.fluid.continuity}."

    def lines(self) -> list[str]:
        row = self._row
        fixed = describe_fixed(self.case, self.parameter, *(one.name for one in self.plan.inputs))
        place = f"{self.parameter}, {row.shown_unit}".rstrip(", ")
        head = f"{place:>16}{'flutters':>10}  {'95 % interval':<17}"
        head += "".join(f"{name:>10}" for name in (*self.others, "undecided")) + f"{'samples':>9}"
        lines = [f"At {fixed}; {only_class_of(self.case.part)}:", *(f"  {one.words()}" for one in self.plan.inputs)]
        lines.append(f"{head}  least damping ratio, %")
        lines += [*map(self._line, self.points), *self._verdict_lines(), *self.deciding_lines()]
        if self.other_law:
            law, other = self.other_law
            rows = [*map(other._line, other.points), *other._verdict_lines()]
            lines += [f"Under {law}:", *rows, *([self.comparison] if self.case.uncertainty.method == "plain" else [])]
        return lines

    def _verdict_lines(self) -> list[str]:
        """Sentences on how verdicts were found, and on those that are undecided."""
        shared, count = (sum(point[name] for point in self.points) for name in ("shared", "samples"))
        said = f"{shared} of {count} verdicts on a space that samples share, the others with their full matrices."
        undecided = _are(self._rows, UNDECIDED)
        places = set(zip(*(self._rows[name][undecided].tolist() for name in ("sample", "value"))))
        notes = [note for note in self.record.notes(_WHY) if note["law"] == self.plan.law]
        why = [note["reason"] for note in notes if (note["sample"], note["value"]) in places]
        first = [f"{undecided.sum()} of {count} verdicts are undecided; the first: {why[0]}"] if why else []
        return [said] * bool(shared) + first

    def _line(self, point: dict[str, Any]) -> str:
        low, middle, high = point["percentiles"]["damping_ratio"]
        chances = (point["outcomes"][name]["probability"] for name in (FLUTTERS, *self.others))
        said, *others = ("-" if one is None else f"{one:.3g}" for one in chances)
        interval = "{:.2g} to {:.2g}".format(*point["interval"])
        spread = "-" if middle is None else "{} ({} to {})".format(*(digits(100 * x) for x in (middle, low, high)))
        value = point["value"] / self._row.scale
        counts = "".join(f"{one:>10}" for one in others) + f"{point['undecided']:10d}{point['samples']:9d}"
        return f"{value:16.6g}{said:>10}  {interval:<17}{counts}  {spread}"

    def deciding_lines(self) -> list[str]:
        """Sentences on the inputs that decide, and on what measuring the first of them would tell."""
        point = self.deciding
        if point is None or not point["decides"] or point["decides"][0]["share"] is None:
            return []
        row, first = PARAMETERS[self.parameter], point["decides"][0]["parameter"]
        parts = [f"{d['parameter']} {100 * d['share']:.0f} %" for d in point["decides"] if (d["share"] or 0) >= 0.01]
        where = row.amount(point["value"], 4)
        lines = [f"Share of the variance of the least damping ratio at {where}: {', '.join(parts)}."]
        known = self.measured(point["value"], first, 0.1)
        if known is not None:
            now, then = (f"{digits(100 * spread[0], 2)} to {digits(100 * spread[2], 2)} %" for spread in known)
            lines.append(
                f"Measure {first} to 10 %: the 95 % interval of the least damping ratio shrinks from {now} to {then} "
                "(if it has its median)."
            )
        return lines

    def _missed(self, lost: int) -> str:
        return f"{lost} of {len(self.plan.values)} values have no steady state"


#: Samples of equal weight that tell as much, below which nothing is said of percentiles.
_ENOUGH = 30.0


def _percentiles(values: np.ndarray, weights: np.ndarray | None = None) -> list[float | None]:
    """2.5, 50 and 97.5 % of values, NaN left out; None where there are none."""
    known = np.isfinite(values)
    if not known.any():
        return [None] * 3
    values = values[known]
    if weights is None:
        return np.percentile(values, [2.5, 50, 97.5]).tolist()
    order = np.argsort(values)
    share = np.cumsum(weights[known][order]) / weights[known].sum()
    return [float(values[order][np.searchsorted(share, q)]) for q in (0.025, 0.5, 0.975)]


STUDY = Study("uncertainty", lambda _mesh: _TABLES, run, UncertaintyResult, check, rows_to_keep=rows_to_keep)
