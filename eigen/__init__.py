"""Spectra of large sparse quadratic pencils with a low-rank, frequency-dependent coupling."""

from .agreement import Certificate
from .block_krylov import LargestPairs, NotConvergedError, largest_pairs
from .certificate import CertifiedSpectrum, certified_spectrum, listed_unstable
from .column import Column
from .columns import ColumnSolver
from .condensation import Workspace
from .coverage import CLEAR
from .derivative import PencilDerivative, difference, eigenvalue_derivative
from .factorization import SingularShiftError
from .family import Condition, PencilFamily
from .mass_basis import NotPositiveError
from .options import SearchOptions
from .pencil import CoupledPencil
from .reduction import FamilyReduction
from .region import Oval, SearchedRegion
from .relaxation import Relaxation
from .search import leading_modes
from .spectrum import Mode, Spectrum
from .tracking import Branches, TrackOptions, track
from .transfer import TransferBasis, lowest_frequencies
from .winding import Count, unstable_count

__all__ = [
    "CLEAR",
    "Branches",
    "Certificate",
    "CertifiedSpectrum",
    "Column",
    "ColumnSolver",
    "Condition",
    "Count",
    "CoupledPencil",
    "FamilyReduction",
    "LargestPairs",
    "Mode",
    "NotConvergedError",
    "NotPositiveError",
    "Oval",
    "PencilDerivative",
    "PencilFamily",
    "Relaxation",
    "SearchOptions",
    "SearchedRegion",
    "SingularShiftError",
    "Spectrum",
    "TrackOptions",
    "TransferBasis",
    "Workspace",
    "certified_spectrum",
    "difference",
    "eigenvalue_derivative",
    "largest_pairs",
    "leading_modes",
    "listed_unstable",
    "lowest_frequencies",
    "track",
    "unstable_count",
]
