"""Results of studies: kept in HDF5 while a run goes on, read back without computing anew, handed to ParaView."""

from .registry import load_result
from .result import Result

__all__ = ["Result", "load_result"]
