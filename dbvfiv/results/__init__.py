"""Results of studies: kept in HDF5 while a run goes on, read back without computing anew, handed to ParaView."""

from ..record.result import Result
from .registry import load_result

__all__ = ["Result", "load_result"]
