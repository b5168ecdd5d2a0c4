"""Public names for type checkers: the package loads them when they are first asked for."""

from .api import Valve as Valve
from .api import load as load
from .api import resume as resume
from .errors import CaseError as CaseError
from .errors import SolveError as SolveError
from .observer import Observer as Observer
from .studies.closure.study import ClosureResult as ClosureResult
from .studies.cycle.study import CycleResult as CycleResult
from .studies.design.study import DesignResult as DesignResult
from .studies.identify.study import IdentifyResult as IdentifyResult
from .studies.levels.study import LevelsResult as LevelsResult
from .studies.map.study import MapResult as MapResult
from .studies.modes.study import ModesResult as ModesResult
from .studies.onset.study import OnsetResult as OnsetResult
from .studies.response.study import ResponseResult as ResponseResult
from .studies.sensitivity.study import SensitivityResult as SensitivityResult
from .studies.session import load_result as load_result
from .studies.state import State as State
from .studies.steady.study import SteadyResult as SteadyResult
from .studies.sweep.study import SweepResult as SweepResult
from .studies.transient.study import TransientResult as TransientResult
from .studies.uncertainty.study import UncertaintyResult as UncertaintyResult

__version__: str
__all__: list[str]
