"""A system seen through products and solves alone, as a large coupled model would offer it."""

from continuation.spectra import shift_invert_spectrum
from continuation.system import System


class OperatorOnly(System):
    """Hides every matrix of another system; counts what is asked of it."""

    def __init__(self, inner, near):
        self.inner, self.size, self.near = inner, inner.size, near
        self.constant_mass = inner.constant_mass
        self.factorisations = 0
        for name in (
            "residual",
            "d_parameter",
            "d2",
            "d3",
            "d2_parameter",
            "d_parameters2",
            "mass_d",
            "mass_d2",
            "mass_parameter",
        ):
            setattr(self, name, getattr(inner, name))

    def linear(self, u, mu):
        self.factorisations += 1
        return _Operators(self.inner.linear(u, mu))

    def spectrum(self, u, mu, count, near=None):
        return shift_invert_spectrum(self.linear(u, mu), count, self.near)


class _Operators:
    __slots__ = ("size", "matvec", "rmatvec", "solve", "solve_transpose", "mass_matvec", "mass_rmatvec", "shifted")

    def __init__(self, linear):
        for name in self.__slots__:
            if name != "shifted":
                setattr(self, name, getattr(linear, name))
        self.shifted = lambda shift: _Solver(linear.shifted(shift))


class _Solver:
    __slots__ = ("matvec", "rmatvec", "solve", "solve_transpose")

    def __init__(self, solver):
        for name in self.__slots__:
            setattr(self, name, getattr(solver, name))
