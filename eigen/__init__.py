"""Spectra of large sparse quadratic pencils with a low-rank, frequency-dependent coupling."""
from .condensation import Workspace
from .factorization import SingularShiftError
from .options import SearchOptions
from .pencil import CoupledPencil
from .region import Oval, SearchedRegion
from .search import leading_modes
from .spectrum import Mode, Spectrum

__all__ = ["CoupledPencil", "Mode", "Oval", "SearchOptions", "SearchedRegion",
           "SingularShiftError", "Spectrum", "Workspace", "leading_modes"]
