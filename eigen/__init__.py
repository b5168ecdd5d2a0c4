"""Spectra of large sparse quadratic pencils with a low-rank, frequency-dependent coupling."""

from .basis import LargestPairs, NotConvergedError, NotPositiveError, TransferBasis, largest_pairs, lowest_frequencies
from .certificate import Certificate, CertifiedSpectrum, certified_spectrum, listed_unstable
from .columns import Cell, Column, ColumnSolver, ReducedColumn
from .count import Count, unstable_count
from .factor import SingularShiftError, Workspace
from .family import PencilFamily, ReducedFamily
from .krylov import KrylovPairs, krylov_pairs
from .operator import CoupledPencil, Relaxation
from .pairs import eigenvalue_derivative
from .reduction import FamilyReduction
from .search import leading_modes
from .spectrum import CLEAR, Mode, Oval, SearchedRegion, SearchOptions, Spectrum
from .tracking import Branches, TrackOptions, track

__all__ = [
    "CLEAR",
    "Branches",
    "Cell",
    "Certificate",
    "CertifiedSpectrum",
    "Column",
    "ColumnSolver",
    "Count",
    "CoupledPencil",
    "FamilyReduction",
    "KrylovPairs",
    "LargestPairs",
    "Mode",
    "NotConvergedError",
    "NotPositiveError",
    "Oval",
    "PencilFamily",
    "ReducedColumn",
    "ReducedFamily",
    "Relaxation",
    "SearchOptions",
    "SearchedRegion",
    "SingularShiftError",
    "Spectrum",
    "TrackOptions",
    "TransferBasis",
    "Workspace",
    "certified_spectrum",
    "eigenvalue_derivative",
    "krylov_pairs",
    "largest_pairs",
    "leading_modes",
    "listed_unstable",
    "lowest_frequencies",
    "track",
    "unstable_count",
]
