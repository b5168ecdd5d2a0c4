"""What can go wrong, each with a sentence that says where and what was tried."""


class ContinuationError(Exception):
    """Base class of the errors of this package."""


class DerivativeMissing(ContinuationError, NotImplementedError):
    """The system does not supply a derivative that the analysis needs."""


class SingularSystem(ContinuationError):
    """A linear system stayed singular after bordering and repair."""


class NotConverged(ContinuationError):
    """An iteration ended without a solution; ``result`` holds what there is.

    Attributes
    ----------
    reason : str
        One word or short phrase, e.g. ``"diverged"``.
    result : object
        The unfinished result, for diagnosis only.
    """

    def __init__(self, message: str, reason: str = "", result=None):
        super().__init__(message)
        self.reason = reason
        self.result = result


class NotABifurcation(ContinuationError):
    """A point handed over as a bifurcation does not qualify as one."""


class OutOfDomain(ContinuationError):
    """For a model to raise where it cannot be evaluated; the step is then tried shorter."""
