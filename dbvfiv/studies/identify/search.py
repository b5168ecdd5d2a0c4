"""Rounds of sampled valves about what measured records leave, and the tables that keep them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...errors import SolveError
from ...record.record import GrowingRecord, Record
from ...record.table import Column, TableSpec
from ..case import Case
from ..inputs import quasi_random
from ..workers import Work, Workers, share_samples
from .learning import MORE, SMALL, Learning, coordinates, sample_posterior
from .valves import MODES, Begins, Modes, Places, Valves

VALVES, SPECTRA, BEGINS, POSTERIOR = "valves", "spectra", "onsets", "posterior"
_VALVES = (
    Column("sample", "", "Number of the valve", "i8"),
    Column("round", "", "0 of valves drawn from the prior, then the round; last the likeliest valve", "i8"),
    Column("input", "", "Number of the input", "i8"),
    Column("score", "", "Independent standard normal score"),
)
_SPECTRA = (
    Column("sample", "", "Number of the valve", "i8"),
    Column("place", "", "Number of the place", "i8"),
    Column("growth_rate", "1/s", "Of its leading modes, NaN where there are fewer", shape=(MODES,)),
    Column("angular_frequency", "rad/s", "Of those modes", shape=(MODES,)),
    Column("alike", "", "Likeness to the modes of the case, in rows", shape=(MODES, MODES)),
)
_BEGINS = (
    Column("sample", "", "Number of the valve", "i8"),
    Column("below", "SI", "Value of the range at which flutter begins below the last record; NaN where it does not"),
    Column("above", "SI", "The same above it"),
)
_POSTERIOR = (
    Column("sample", "", "Number of the sample of the posterior", "i8"),
    Column("input", "", "Number of the input; then the common errors of frequencies and damping", "i8"),
    Column("score", "", "Independent standard normal score"),
)
#: Valves and their modes, and samples of the posterior.
TABLES = (
    TableSpec(VALVES, _VALVES, chunk=512),
    TableSpec(SPECTRA, _SPECTRA, chunk=64),
    TableSpec(BEGINS, _BEGINS),
    TableSpec(POSTERIOR, _POSTERIOR, chunk=512),
)
_LOST = "lost valve"
#: Samples of the posterior at least, and valves that a worker takes at a time.
SAMPLES, OWN = 1000, 4


def prepare_valves(case: dict, known: list) -> Valves:
    """Context of a worker, from the case as plain data and what is known of it at each place."""
    places = Places(Case.from_dict(case))
    return Valves(places.plan, places, known)


class Search:
    """Rounds of valves; what an earlier attempt kept is not computed again."""

    def __init__(self, plan, places, lines, record: GrowingRecord, team: Workers):
        self.plan, self.places, self.lines, self.record, self.team = plan, places, lines, record, team
        self.scores, self.rounds = np.zeros((0, len(plan.inputs))), np.zeros(0, int)
        self.modes, self.begins = kept_modes(record), kept_onsets(record)
        self.left_out: tuple[int, ...] = ()
        self.written = int(record.column(VALVES, "sample").max(initial=-1)) + 1

    def learn(self) -> tuple[Learning, np.ndarray, int]:
        """Samples of the prior, then rounds about what the records leave until measurement is the larger error, all
        where the records were taken; and a last round over the whole range too.
        """
        asked, width = self.plan.case.identify, len(self.plan.inputs)
        self._ask(quasi_random(asked.samples, width, asked.seed), 0, self.places.first)
        z, number = self._posterior(0), 0
        while number < asked.rounds and (number == 0 or self._learning().emulation(z) > SMALL):
            number += 1
            self._ask(_some(z, asked.round)[:, :width], number, self.places.first)
            z = self._posterior(number)
        number += 1
        self._ask(_some(z, max(asked.round, width + 2 * MORE))[:, :width], number, range(len(self.places.moved)))
        z = self._posterior(number)
        return self._learning(), z, number

    def check(self, learning: Learning, z: np.ndarray, number: int) -> dict[str, Any]:
        """The likeliest valve by the full model beside what was emulated of it."""
        value = learning.log_likelihood(z) - 0.5 * (z**2).sum(axis=1)
        best = z[[int(np.argmax(value))]]
        self._ask(best[:, : len(self.plan.inputs)], number, range(len(self.places.moved)))
        whole = self._learning()
        rows = []
        for line, share in zip(self.lines, learning.matches(z)):
            place, mode = self.places.of_line(line), int(np.argmax(share[:-1]))
            points = learning.modal(place).at(coordinates(self.plan, best[:, : len(self.plan.inputs)]))
            full = whole.followed(place)[-1, mode]
            rows.append(
                {
                    "measured": [line.frequency, line.damping_ratio],
                    "emulated": [float(part[0, mode]) for part in points],
                    "full": full.tolist(),
                }
            )
        return {"scores": best[0].tolist(), "modes": rows}

    def _learning(self) -> Learning:
        known = self.scores, self.rounds, self.modes, self.begins
        return replace(learned_from(self.plan, self.places, self.lines, *known), left_out=self.left_out)

    def _posterior(self, number: int) -> np.ndarray:
        self.left_out = ()
        learning = self._learning()
        for place in self.places.first:
            if not np.isfinite(learning.modal(place).error).any():
                raise SolveError(f"Too few sampled valves have modes at {self.places.words(place)} to learn from.")
        z, evidence = self._sampled(learning, number)
        while doubtful := learning.doubtful(z):
            others = []
            for line in doubtful:
                other = replace(learning, left_out=(*learning.left_out, line))
                samples, less = self._sampled(other, number)
                others.append((less + learning.evidence_of_none(line), less, other, samples))
            best = max(others, key=lambda one: one[0])
            if best[0] <= evidence:
                break
            _, evidence, learning, z = best
        self.left_out = learning.left_out
        self.record.progress(
            f"round {number}: logarithm of the evidence {evidence:.4g}, error of emulated modes "
            f"{learning.emulation(z):.2g} of the measurement's"
        )
        return z

    def _sampled(self, learning: Learning, number: int) -> tuple[np.ndarray, float]:
        asked = self.plan.case.identify
        count = max(SAMPLES, asked.round)  # no valve of a round is drawn twice
        return sample_posterior(learning.log_likelihood, learning.dimension, count, asked.seed + number)

    def _ask(self, scores: np.ndarray, number: int, places: Sequence[int]) -> None:
        first = len(self.scores)
        self.scores = np.vstack([self.scores, scores])
        self.rounds = np.append(self.rounds, np.full(len(scores), number))
        numbers = self.plan.numbers(scores)
        for sample in range(max(self.written, first), len(self.scores)):
            one = {"sample": [sample] * scores.shape[1], "round": [number] * scores.shape[1]}
            one |= {"input": list(range(scores.shape[1])), "score": scores[sample - first].tolist()}
            self.record.extend(VALVES, one)
        self.written = max(self.written, len(self.scores))

        def wanted(sample: int) -> bool:
            onset = len(places) > len(self.places.first) and sample not in self.begins
            return onset or any((sample, place) not in self.modes for place in places)

        for _, rows in share_samples(self.team, "Valves", Work(Valves.found, (places,)), numbers, first, OWN, wanted):
            for row in rows:
                self._keep(row)
            self.record.item(rows[-1].sample)

    def _keep(self, row: Modes | Begins) -> None:
        if isinstance(row, Begins):
            if row.sample not in self.begins:
                self.begins[row.sample] = row[1:]
                self.record.append(BEGINS, row._asdict())
            return
        if (row.sample, row.place) in self.modes:
            return
        if row.why:
            self.record.note(_LOST, sample=row.sample, place=row.place, reason=row.why)
        self.modes[row.sample, row.place] = row.eigenvalues, row.alike
        values = row.sample, row.place, row.eigenvalues.real, row.eigenvalues.imag, row.alike
        self.record.append(SPECTRA, dict(zip((column.name for column in _SPECTRA), values)))


def _some(z: np.ndarray, count: int) -> np.ndarray:
    """Some of the samples of a posterior, evenly over their list."""
    return z[np.linspace(0, len(z) - 1, count).astype(int)]


def kept_modes(record: Record) -> dict[tuple[int, int], tuple[np.ndarray, np.ndarray]]:
    """Eigenvalues and likeness by sample and place."""
    sample, place, growth, turns, alike = (record.column(SPECTRA, column.name) for column in _SPECTRA)
    return {(int(s), int(p)): (growth[i] + 1j * turns[i], alike[i]) for i, (s, p) in enumerate(zip(sample, place))}


def kept_onsets(record: Record) -> dict[int, tuple[float, float]]:
    """Onsets below and above by sample."""
    sample, below, above = (record.column(BEGINS, column.name) for column in _BEGINS)
    return {int(s): (b, a) for s, b, a in zip(sample, below, above)}


def learned_from(plan, places, lines, scores, rounds, modes, begins) -> Learning:
    """Likelihood and emulated modes from the scores of valves, their modes by sample and place, and onsets."""
    empty = np.full(MODES, np.nan + 0j), np.zeros((MODES, MODES))
    table = {}
    for place in range(len(places.moved)):
        rows = [modes.get((sample, place), empty) for sample in range(len(scores))]
        table[place] = np.array([row[0] for row in rows]), np.array([row[1] for row in rows])
    known = np.array([begins.get(sample, (np.nan, np.nan)) for sample in range(len(scores))])
    return Learning(plan, places, lines, scores, rounds, table, known.reshape(-1, 2))
