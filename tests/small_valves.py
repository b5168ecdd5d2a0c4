"""A valve on a mesh on which a step takes a millisecond, and the mesh of earlier versions for what was tuned on it."""

from functools import cache
from types import MappingProxyType

import dbvfiv
from dbvfiv.model import ValveModel
from dbvfiv.motion.start import steady_positions
from dbvfiv.studies.case import THESIS, thesis_case


def settings(keys, base=THESIS) -> tuple[str, ...]:
    """Options of a command for keys, and by default for the thesis's settings, for a command without a case file."""
    told = {key: str(value).lower() if isinstance(value, bool) else value for key, value in (base | keys).items()}
    return tuple(f"--set={key}={value}" for key, value in told.items())


THESIS_SET = settings({})
#: Rows and columns at even distances; with the element of earlier versions too.
EVEN = MappingProxyType({"mesh.rows": "uniform", "mesh.columns": "uniform"})
FORMER = MappingProxyType({"mesh.element": "MITC4", **EVEN})
#: The coarsest mesh on which studies give sound answers.
SMALL = MappingProxyType({"mesh.around": 6, "mesh.along": 8})


def load_small(*keys):
    """The 12-inch valve on the small mesh with tables of keys changed, later ones first."""
    changes = dict(SMALL)
    for some in keys:
        changes |= some
    return dbvfiv.load(thesis_case(), changes)


@cache
def small_model(*changes):
    case = thesis_case(SMALL | dict(changes))
    return ValveModel(case)


def make_valve(changes=MappingProxyType({})):
    """A coarse model with some keys of its case changed."""
    return small_model(*sorted((k, tuple(v) if isinstance(v, list) else v) for k, v in changes.items()))


@cache
def find_open_state():
    """A strongly deformed equilibrium of the coarse mesh."""
    return steady_positions(small_model(), 12e3)
