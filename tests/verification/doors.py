"""Random steady states asked by every study that gives a verdict: modes, a map around, an onset across, a sweep."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from dbvfiv.case.parameters import Mu
from dbvfiv.errors import CaseError, NotValidError, SolveError
from dbvfiv.model.state import SteadyState
from dbvfiv.observer import Observer
from dbvfiv.studies.case import Case, load_case
from dbvfiv.studies.modes.search import run_modes
from dbvfiv.studies.onset.search import run_onset
from dbvfiv.studies.session import Session
from dbvfiv.studies.stability.verdict import UNDECIDED, Verdict
from dbvfiv.studies.stability.walk import StabilityWalk
from tests.studies.map.axes import run_map

#: Case files.
VALVES = (
    "cases/dbv12-in-line.toml",
    "cases/dbv18.toml",
    "cases/dbv6.toml",
    "cases/dbv36.toml",
    "cases/dbv4-wide.toml",
    "cases/loss-factor.toml",
    "cases/dbv12.toml",
)
#: Relative step to the neighbours that a map, an onset and a sweep have beside the state.
STEP = 1e-3
#: Length of pipe in front where there is one, m.
PIPE = 20.0


@dataclass
class Asked:
    """One random state and the verdicts on it by study."""

    case: Case
    number: int
    verdicts: dict[str, Verdict] = field(default_factory=dict)
    failure: str = ""

    @property
    def outcomes(self) -> dict[str, str]:
        """Outcome by study."""
        return {name: verdict.outcome for name, verdict in self.verdicts.items()}

    @property
    def agree(self) -> bool:
        """All studies that decide give one outcome."""
        return len(set(self.outcomes.values()) - {UNDECIDED}) <= 1

    @property
    def left_open(self) -> bool:
        """Some study does not decide."""
        return UNDECIDED in self.outcomes.values()

    def __str__(self) -> str:
        c = self.case
        lead = next(iter(self.verdicts.values()), None)
        return (
            f"{self.number}: {c.drive.pressure:.5g} Pa, {c.fluid.density:.4g} kg/m3, {c.fluid.continuity}, "
            f"alpha {c.damping.alpha:.3g}, beta {c.damping.beta:.3g}, loss factor {c.damping.loss_factor:.3g}, "
            f"line {c.upstream.length}, outside {c.outside.fluid}: {self.outcomes} {lead and lead.growth_rate} "
            f"{self.failure}"
        )


def random_cases(
    number: int, seed: int, valves=VALVES, each: int = 10, mesh: tuple[int, int] = (6, 10)
) -> Iterator[tuple[int, Case]]:
    """Random cases: 0.05 to 50 kPa, 0.5 to 2000 kg/m3, loss factors scaled by 0.2 to 3 or Rayleigh damping, both flow
    models, with and without 20 m of pipe, on `mesh` elements around and along; `each` of them share a valve and a
    pressure.
    """
    rng = np.random.default_rng(seed)
    for first in range(0, number, each):
        path = valves[(first // each) % len(valves)]
        base = _settled(path, mesh)
        pipe = rng.random() < 0.5
        line = {"upstream.length": PIPE, "upstream.diameter": 2.2 * base.valve.flange_radius}
        base = base.replace(line if pipe else {"upstream": {}})
        base = base.replace({"drive.pressure": float(50.0 * 1000.0 ** rng.random())})
        for i in range(first, min(first + each, number)):
            yield i, base.replace(_random_surroundings(rng, base))


@cache
def _settled(path: str, mesh: tuple[int, int]) -> Case:
    """A case on a coarse mesh, with its strain levels settled."""
    around, along = mesh
    return Session(load_case(path, [f"mesh.around={around}", f"mesh.along={along}"])).settle().case


def _random_surroundings(rng: np.random.Generator, base: Case) -> dict:
    density, kind, size, law = rng.random(4)
    changes = {
        "fluid.density": float(0.5 * 4000.0**density),
        "fluid.continuity": "storage" if law < 0.5 else "quasi-steady",
    }
    if kind < 0.3 or not base.damping.relaxes:
        beta = float(1e-4 * 50.0**size)
        return changes | {"damping": {"model": "rayleigh", "alpha": 0.0, "beta": beta}}
    return changes | {"damping.loss_factor": float(0.2 * 15.0**size)}


def ask_all(cases) -> Iterator[Asked]:
    """Every study on every case; a steady state that several cases share is found once."""
    key, state = None, None
    for number, case in cases:
        asked = Asked(case, number)
        # what else moves the steady state: damping does not, the fluid does not without friction in a line
        own = case.to_dict()
        own = repr([own[name] for name in ("valve", "mesh", "layers", "materials", "drive", "upstream")])
        try:
            session = Session(case, "random", state if own == key else None)
            state = session.equilibrium(Observer())
            key = own
            asked.verdicts = dict(verdicts_of(session, state))
        except (SolveError, CaseError) as error:
            asked.failure = str(error)
        yield asked


def verdicts_of(session: Session, state: SteadyState) -> Iterator[tuple[str, Verdict]]:
    """Verdicts on one state by every study."""
    case, model, here = session.case, session.model, Mu.of(session.case)
    try:
        yield "modes", run_modes(model, state, keys=case.modes).verdict
    except NotValidError as error:
        yield "modes", Verdict.not_valid(str(error))
    plain = {"map.curve": False, "map.refine": 0, "map.checks": 0, "map.continuity": "case"}
    p, rho = here.pressure, here.density
    axes = {"map.x": f"pressure={p!r}:{p * (1 + STEP)!r}:2", "map.y": f"density={rho!r}:{rho * (1 + STEP)!r}:2"}
    found = run_map(case.replace(plain | axes), start=state, workers=1)
    yield "map", found.columns[0].verdict(0, 0)
    around = (rho / (1 + STEP), rho, rho * (1 + STEP))
    over = {"onset.over": f"density={','.join(map(repr, around))}", "onset.normal_form": False, "onset.coarse_mesh": 0}
    onset = run_onset(case.replace(over), walk=_walk(case, model, here, state))
    yield "onset", onset.verdicts[list(onset.values).index(rho)]
    over = {"sweep.over": f"density={rho!r}:{rho * (1 + STEP)!r}:2"}
    yield "sweep", Session(case.replace(over), start=state).perform("sweep").verdicts[0]


def _walk(case: Case, model, here: Mu, state: SteadyState) -> StabilityWalk:
    walk = StabilityWalk(case, model=model)
    walk.give(here, state.q)
    return walk
