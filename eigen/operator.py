r"""Parameter-separable operator: structure with a low-rank coupling and relaxing stiffness, and families of such."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, fields, replace
from functools import cached_property

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from .spectrum import CLEAR


@dataclass(frozen=True, eq=False)
class Relaxation:
    r"""Parts of a stiffness that relax, each with strengths of its own over common times.

    .. math:: \sum_g \varphi_g(\lambda) K_g, \qquad
        \varphi_g(\lambda) = \sum_j g_{gj} \frac{\lambda \tau_j}{1 + \lambda \tau_j}

    comes on top of the slow stiffness K of a pencil. With :math:`z_j = q / (1 + \lambda \tau_j)` it is linear in
    lambda: :math:`\lambda \tau_j z_j = q - z_j`, force :math:`\sum_j N_j (q - z_j)`, :math:`N_j = \sum_g g_{gj} K_g`.

    Parameters
    ----------
    matrices : sequence of real sparse or dense matrices, shape (n, n)
        K_g.
    strengths : array, shape (g, j)
        Not negative, over the slow stiffness.
    times : array, shape (j,)
        Relaxation times, s, positive.

    Raises
    ------
    ValueError
        If shapes do not fit, a strength is negative or a time is not positive.

    Examples
    --------
    >>> relaxation = Relaxation([np.eye(1)], [[0.2]], [0.01])
    >>> relaxation.factors(0.0), relaxation.factors(1e9).round(6)
    (array([0.]), array([0.2]))
    """

    matrices: tuple[sp.csr_matrix, ...]
    strengths: np.ndarray
    times: np.ndarray

    def __repr__(self) -> str:
        return f"<Relaxation: {len(self.matrices)} parts of a stiffness, {self.branches} times>"

    def __post_init__(self):
        matrices = tuple(sp.csr_matrix(m, dtype=float) for m in self.matrices)
        strengths = np.array(self.strengths, float, ndmin=2)
        times = np.array(self.times, float, ndmin=1)
        if strengths.shape != (len(matrices), times.size):
            raise ValueError(f"Strengths have shape {strengths.shape}; {(len(matrices), times.size)} is needed.")
        if not (np.isfinite(strengths).all() and (strengths >= 0).all()):
            raise ValueError("Strengths of relaxation must be finite and not negative.")
        if not (np.isfinite(times).all() and (times > 0).all()):
            raise ValueError("Relaxation times must be finite and positive.")
        for name, value in (("matrices", matrices), ("strengths", strengths), ("times", times)):
            if isinstance(value, np.ndarray):
                value.setflags(write=False)
            object.__setattr__(self, name, value)

    @property
    def branches(self) -> int:
        """Number of relaxation times."""
        return self.times.size

    def factors(self, s) -> np.ndarray:
        """phi_g(s), shape (g, ...) for s of shape (...)."""
        x = np.multiply.outer(self.times, np.asarray(s))
        return np.tensordot(self.strengths, x / (1.0 + x), 1)

    def slopes(self, s) -> np.ndarray:
        """Derivatives of the factors by s, shape (g, ...)."""
        return self.quotients(s, s)

    def quotients(self, a, b) -> np.ndarray:
        """(phi_g(a) - phi_g(b)) / (a - b), shape (g, ...), of a and b that broadcast; the slope where they meet."""
        a, b = np.asarray(a), np.asarray(b)
        times = self.times.reshape((-1,) + (1,) * np.broadcast(a, b).ndim)
        return np.tensordot(self.strengths, times / ((1.0 + a * times) * (1.0 + b * times)), 1)

    def beside(self, line: float) -> tuple[np.ndarray, Relaxation]:
        """phi_g(line) and the relaxation in z = s - line: phi_g(s) = phi_g(line) + what relaxes with z.

        Raises
        ------
        ValueError
            If the line does not lie right of all poles -1/tau_j.
        """
        below = 1.0 + line * self.times
        if not (below > 0).all():
            raise ValueError(
                f"A growth rate of {line:.6g} 1/s lies left of the creep at {-1 / self.times.max():.6g} 1/s."
            )
        return self.factors(line), self.replace(self.strengths / below, self.times / below)

    def replace(self, strengths, times=None) -> Relaxation:
        """Matrices with other strengths and, where given, times."""
        return Relaxation(self.matrices, strengths, self.times if times is None else times)


#: Complex columns up to which a sparse product is faster one real column after another.
FEW = 2

#: Rates of a fluid that rounding leaves, relative to the largest; share by which a zero that is met is moved.
ROUNDING, MET = 1e-13, 1e-10
#: Relative error of a fluid condensed by its motions beyond which every place is solved for.
ALIKE = 1e-7

FLUID_PARTS = ("A0", "A1", "A2", "B0", "B1", "R0", "R1", "R2", "S0", "S1")


@dataclass(frozen=True, eq=False)
class CoupledPencil:
    r"""Structure and fluid of a linearised coupled state.

    .. math::
        (\lambda^2 M + \lambda C + K + \sum_g \varphi_g(\lambda) K_g) q &= G p, \qquad y = J q \\
        p &= (A_0 + \lambda A_1 + \lambda^2 A_2) y + (B_0 + \lambda B_1) U \\
        0 &= (R_0 + \lambda R_1 + \lambda^2 R_2) y + (S_0 + \lambda S_1) U

    With q the n structural unknowns (constrained ones already eliminated), p and y the m
    coupling forces and motions, U the b inner unknowns of the fluid.

    Parameters
    ----------
    M, C, K : sparse or dense, shape (n, n)
        Real. K, C need not be symmetric; C need not be proportional.
    G : sparse or dense, shape (n, m), optional
    J : sparse or dense, shape (m, n), optional
        Both absent: no coupling (m = 0).
    A0, A1, A2 : array, shape (m, m), optional
        A missing part is zero.
    B0, B1 : array, shape (m, b), optional
    R0, R1, R2 : array, shape (b, m), optional
    S0, S1 : array, shape (b, b), optional
        The number b is read from any of the parts given.
    relaxation : Relaxation, optional
        What relaxes of the stiffness, phi_g and K_g; without it the pencil is quadratic.

    Raises
    ------
    ValueError
        If shapes do not fit or a part holds a number that is not finite.

    Examples
    --------
    >>> import numpy as np
    >>> pencil = CoupledPencil(M=np.eye(1), C=[[0.1]], K=[[1.0]])
    >>> pencil.n, pencil.m, pencil.b
    (1, 0, 0)
    """

    M: sp.csr_matrix
    C: sp.csr_matrix
    K: sp.csr_matrix
    G: sp.csr_matrix | None = None
    J: sp.csr_matrix | None = None
    relaxation: Relaxation | None = None
    _: KW_ONLY
    A0: np.ndarray | None = None
    A1: np.ndarray | None = None
    A2: np.ndarray | None = None
    B0: np.ndarray | None = None
    B1: np.ndarray | None = None
    R0: np.ndarray | None = None
    R1: np.ndarray | None = None
    R2: np.ndarray | None = None
    S0: np.ndarray | None = None
    S1: np.ndarray | None = None

    def __repr__(self) -> str:
        relaxing = "" if self.relaxation is None else f", {self.relaxation.branches} relaxation times"
        return f"<CoupledPencil: {self.n} structural and {self.b} fluid unknowns, {self.m} coupled motions{relaxing}>"

    def __post_init__(self):
        for name in ("M", "C", "K"):
            self._put(name, _real_csr(name, getattr(self, name)))
        n = self.M.shape[0]
        if (self.G is None) != (self.J is None):
            raise ValueError("G and J belong together: give both or neither.")
        for name, empty in (("G", (n, 0)), ("J", (0, n))):
            value = getattr(self, name)
            self._put(name, _real_csr(name, sp.csr_matrix(empty) if value is None else value))
        m = self.G.shape[1]
        self._check({"M": (n, n), "C": (n, n), "K": (n, n), "G": (n, m), "J": (m, n)})
        for matrix in () if self.relaxation is None else self.relaxation.matrices:
            if matrix.shape != (n, n):
                raise ValueError(f"A relaxing stiffness of the pencil has shape {matrix.shape}; {(n, n)} is needed.")
        self._check_fluid()

    def _check_fluid(self):
        """Fill in the parts of the fluid that are missing, and check all of them."""
        m, b = self.m, 0
        for name, axis in (("S0", 0), ("S1", 0), ("R0", 0), ("R1", 0), ("R2", 0), ("B0", 1), ("B1", 1)):
            if getattr(self, name) is not None:
                b = np.atleast_2d(np.asarray(getattr(self, name))).shape[axis]
                break
        shapes = {}
        for name in FLUID_PARTS:
            shapes[name] = {"A": (m, m), "B": (m, b), "R": (b, m), "S": (b, b)}[name[0]]
            value = getattr(self, name)
            value = np.zeros(shapes[name]) if value is None else np.array(value, float, ndmin=2)
            value.setflags(write=False)
            self._put(name, value)
        self._check(shapes)

    def _check(self, shapes):
        for name, shape in shapes.items():
            value = getattr(self, name)
            if value.shape != shape:
                raise ValueError(f"The part {name} of the pencil has shape {value.shape}; {shape} is needed.")
            data = value.data if sp.issparse(value) else value
            if not np.isfinite(data).all():
                raise ValueError(f"The part {name} of the pencil holds a number that is not finite.")

    def _put(self, name, value):
        object.__setattr__(self, name, value)

    @property
    def n(self) -> int:
        """Number of structural unknowns."""
        return self.M.shape[0]

    @property
    def m(self) -> int:
        """Number of coupling forces."""
        return self.G.shape[1]

    @property
    def b(self) -> int:
        """Number of inner unknowns of the fluid."""
        return self.S0.shape[0]

    @property
    def order(self) -> int:
        """Size of the first-order form in (q, dq/dt, U, z), with z of each relaxation time as long as q."""
        return 2 * self.n + self.b + self.branches * self.n

    @property
    def branches(self) -> int:
        """Number of relaxation times."""
        return 0 if self.relaxation is None else self.relaxation.branches

    @property
    def typical_frequency(self) -> float:
        """Angular frequency of a typical unknown by itself, rad/s; 1 where there is none."""
        stiffness, inertia = np.abs(self.K.diagonal()), np.abs(self.M.diagonal())
        value = np.sqrt(np.median(stiffness) / np.median(inertia)) if self.n else 1.0
        return float(value) if np.isfinite(value) and value > 0 else 1.0

    @property
    def relaxing(self) -> tuple[sp.csr_matrix, ...]:
        """Parts K_g of the stiffness that relax."""
        return () if self.relaxation is None else self.relaxation.matrices

    def replace(self, **parts) -> CoupledPencil:
        """Pencil with some parts exchanged; the structure is not checked again where the fluid alone is."""
        if not set(parts) <= set(FLUID_PARTS):
            return replace(self, **parts)
        other = object.__new__(type(self))
        for name in (part.name for part in fields(CoupledPencil)):
            other._put(name, parts[name] if name in parts else getattr(self, name))
        other._check_fluid()
        return other

    @cached_property
    def fluid(self) -> FluidMotions:
        """The fluid by its own motions."""
        return FluidMotions({name: getattr(self, name) for name in FLUID_PARTS})

    def fluid_at(self, s: complex):
        """Values A(s), B(s), R(s), S(s) of the fluid polynomials."""
        return fluid_values(vars(self), s)

    def polynomial(self, *vectors, transposed: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """Sum T_0 x_0 + T_1 x_1 + T_2 x_2 of the coefficients of 1, lambda and lambda^2, what relaxes left out.

        Parameters
        ----------
        vectors : pairs (q, U), arrays of shape (n,) or (n, k) and (b,) or (b, k), real or complex
            None for one that is not there.
        transposed : bool
            With the transposes of the coefficients.

        Returns
        -------
        f, g : arrays of shape (n, ...) and (b, ...)
        """
        forces, slope = (self.J.T, self.G.T) if transposed else (self.G, self.J)
        f, inner = 0.0, 0.0
        for x, matrix, fluid in zip(vectors, (self.K, self.C, self.M), self._bordered):
            if x is None:
                continue
            q, u = x
            f = f + real_apply(matrix.T if transposed else matrix, q)
            inner = inner + (fluid.T if transposed else fluid) @ np.concatenate([real_apply(slope, q), u])
        return f + real_apply(forces, inner[: self.m]), inner[self.m :]

    @cached_property
    def _bordered(self) -> list[np.ndarray]:
        """[-A, -B; R, S] of each power of lambda, (m + b, m + b): with (G, 1) and (J, 1) beside it all that couples."""
        none = {"B2": np.zeros_like(self.B0), "S2": np.zeros_like(self.S0)}
        A, B, R, S = ([none.get(f"{n}{k}", getattr(self, f"{n}{k}", None)) for k in range(3)] for n in "ABRS")
        return [np.block([[-a, -b], [r, s]]) for a, b, r, s in zip(A, B, R, S)]

    @cached_property
    def norms(self) -> tuple[np.ndarray, ...]:
        """Norms by powers of lambda of what acts on q and on U, in the structure and in each row of the fluid, as rows
        may carry different units; and those of the parts that relax.
        """
        g, j = _norm(self.G), _norm(self.J)
        pairs = (self.K, self.A0), (self.C, self.A1), (self.M, self.A2)
        structure = [_norm(wall) + g * j * np.linalg.norm(a) for wall, a in pairs]
        inner = [g * np.linalg.norm(b) for b in (self.B0, self.B1)]
        rows = [j * np.linalg.norm(r, axis=1) for r in (self.R0, self.R1, self.R2)]
        own = [np.linalg.norm(s, axis=1) for s in (self.S0, self.S1)]
        return tuple(map(np.array, (structure, inner, rows, own, [_norm(matrix) for matrix in self.relaxing])))

    def apply(self, s, q: np.ndarray, u: np.ndarray, transposed: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """T(s) x of vectors (q, u), each column with an s of its own where s is (k,); see `polynomial`."""
        f, g = self.polynomial((q, u), (s * q, s * u), (s * s * q, s * s * u), transposed=transposed)
        return f + self._relaxed(Relaxation.factors, s, q, transposed), g

    def apply_derivative(self, s, q: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """T'(s) x of vectors (q, u), as `apply`."""
        f, g = self.polynomial(None, (q, u), (2 * s * q, 2 * s * u))
        return f + self._relaxed(Relaxation.slopes, s, q), g

    def _relaxed(self, of, s, q: np.ndarray, transposed: bool = False) -> np.ndarray | float:
        """Sum of K_g q with factors or slopes `of` the relaxation at s."""
        if self.relaxation is None:
            return 0.0
        parts = ((x, matrix.T if transposed else matrix) for x, matrix in zip(of(self.relaxation, s), self.relaxing))
        return sum(x * real_apply(matrix, q) for x, matrix in parts)

    def terms(self, s: np.ndarray, q: np.ndarray, U: np.ndarray):
        """Terms whose sums are the two block rows of T(s) x, which residuals are measured against.

        Parameters
        ----------
        s : array, shape (k,)
        q, U : arrays, shapes (n, k) and (b, k)

        Returns
        -------
        structure : list of arrays, shape (n, k)
            Inertia, damping, stiffness, minus the coupling through y, minus that through U; then what relaxes.
        fluid : list of arrays, shape (b, k)
        """
        y = real_apply(self.J, q)
        motion = self.A0 @ y + s * (self.A1 @ y) + s**2 * (self.A2 @ y)
        structure = [s**2 * real_apply(self.M, q), s * real_apply(self.C, q), real_apply(self.K, q)]
        structure += [-real_apply(self.G, part) for part in (motion, self.B0 @ U + s * (self.B1 @ U))]
        if self.relaxation is not None:
            structure += [x * real_apply(k, q) for x, k in zip(self.relaxation.factors(s), self.relaxing)]
        fluid = [self.R0 @ y, s * (self.R1 @ y), s**2 * (self.R2 @ y), self.S0 @ U, s * (self.S1 @ U)]
        return structure, fluid

    def projected(self, V: np.ndarray) -> CoupledPencil:
        """Pencil on a space (n, k): an operator of the same form."""
        relaxation = self.relaxation
        if relaxation is not None:
            parts = [V.T @ (matrix @ V) for matrix in relaxation.matrices]
            relaxation = Relaxation(parts, relaxation.strengths, relaxation.times)
        M, C, K = (V.T @ (matrix @ V) for matrix in (self.M, self.C, self.K))
        return replace(self, M=M, C=C, K=K, G=V.T @ self.G, J=self.J @ V, relaxation=relaxation)

    @cached_property
    def dense(self) -> np.ndarray:
        """Dense coefficients of 1, lambda and lambda^2, (3, n + b, n + b), what relaxes left out; for small pencils."""
        unit, found = np.eye(self.b), np.zeros((3, self.n + self.b, self.n + self.b))
        forces, slope = la.block_diag(self.G.toarray(), unit), la.block_diag(self.J.toarray(), unit)
        for own, matrix, fluid in zip(found, (self.K, self.C, self.M), self._bordered):
            own[:] = forces @ fluid @ slope
            own[: self.n, : self.n] += matrix.toarray()
        return found

    def first_order(self) -> tuple[np.ndarray, np.ndarray]:
        """Dense F, E with F x = lambda E x, x = (q, lambda q, U, z); for small pencils.

        Returns
        -------
        F, E : ndarray, shape (order, order)
        """
        n, b = self.n, self.b
        F, E = np.zeros((self.order, self.order)), np.zeros((self.order, self.order))
        q, v, u, both = slice(0, n), slice(n, 2 * n), slice(2 * n, 2 * n + b), slice(n, 2 * n + b)
        first, second, third = self.dense
        E[q, q] = F[q, v] = np.eye(n)
        E[both, v], E[both, u] = third[:, :n], second[:, n:]
        F[both, q], F[both, v], F[both, u] = -first[:, :n], -second[:, :n], -first[:, n:]
        parts = [matrix.toarray() for matrix in self.relaxing]
        for j in range(self.branches):
            z = slice(2 * n + b + j * n, 2 * n + b + (j + 1) * n)
            part = sum(x * m for x, m in zip(self.relaxation.strengths[:, j], parts))
            F[v, q] -= part
            F[v, z] = part
            F[z, q] = np.eye(n)
            F[z, z] = -np.eye(n)
            E[z, z] = self.relaxation.times[j] * np.eye(n)
        return F, E


def _norm(matrix) -> float:
    if 0 in matrix.shape or matrix.nnz == 0:
        return 0.0
    return float(np.sqrt(spla.norm(matrix, 1) * spla.norm(matrix, np.inf)))


def fluid_values(p: Mapping[str, np.ndarray], s: complex):
    """Values A(s), B(s), R(s), S(s) of the polynomials of a coupling."""
    return (
        p["A0"] + s * (p["A1"] + s * p["A2"]),
        p["B0"] + s * p["B1"],
        p["R0"] + s * (p["R1"] + s * p["R2"]),
        p["S0"] + s * p["S1"],
    )


def real_apply(matrix, x: np.ndarray) -> np.ndarray:
    """Real sparse matrix times a complex array without making the matrix complex."""
    if not np.iscomplexobj(x):
        return matrix @ x
    if x.size == 0 or matrix.shape[0] == 0:
        return np.zeros((matrix.shape[0],) + x.shape[1:], complex)
    flat = np.ascontiguousarray(x).reshape(x.shape[0], -1)
    if flat.shape[1] <= FEW and sp.issparse(matrix):
        out = np.stack([matrix @ column.real + 1j * (matrix @ column.imag) for column in flat.T], axis=1)
        return out.reshape((matrix.shape[0],) + x.shape[1:])
    out = matrix @ flat.view(float).reshape(flat.shape[0], -1)
    return np.ascontiguousarray(out).view(complex).reshape((matrix.shape[0],) + x.shape[1:])


def _real_csr(name: str, value) -> sp.csr_matrix:
    dtype = value.dtype if hasattr(value, "dtype") else np.asarray(value).dtype
    if np.issubdtype(dtype, np.complexfloating):
        raise ValueError(f"The part {name} of the pencil must be real.")
    if sp.issparse(value) and value.format == "csr" and value.dtype == float:
        matrix = value
    else:
        matrix = sp.csr_matrix(value, dtype=float)
    if not matrix.has_canonical_format:
        matrix = matrix.copy()
        matrix.sum_duplicates()
    return matrix


class FluidMotions:
    """Inner unknowns of a fluid condensed by the motions that it has between walls at rest.

    With S(sigma)^-1 S1 = X diag(k) X^-1 at some real sigma, S(s)^-1 = X diag(1 / d) X^-1 S(sigma)^-1 where
    d = 1 + (s - sigma) k: a place costs products alone, however many unknowns a long line brings. Made of the parts A0
    to S1 of a `CoupledPencil`.

    Attributes
    ----------
    zeros : (j,) complex array
        Finite zeros of det S(s).
    """

    def __init__(self, parts: Mapping[str, np.ndarray]):
        S0, S1 = parts["S0"], parts["S1"]
        self._parts, self._A = parts, [parts[f"A{power}"] for power in range(3)]
        size = np.abs(S0).max(initial=0.0), np.abs(S1).max(initial=0.0)
        shift = size[0] / size[1] if min(size) > 0 else 1.0
        # of one unknown either of them may be the zero itself
        self._shift, (sign, log) = max(
            ((s, np.linalg.slogdet(S0 + s * S1)) for s in (shift, -shift)), key=lambda x: x[1][1]
        )
        if sign == 0:
            raise ValueError("The inner unknowns of the fluid are not determined by their own equations.")
        self._log = log + 1j * np.angle(sign)
        columns = np.hstack([S1, *(parts[f"R{power}"] for power in range(3))])
        rates, rows = np.split(np.linalg.solve(S0 + self._shift * S1, columns), [len(S0)], axis=1)
        self._rates, X = np.linalg.eig(rates) if len(S0) else (np.zeros(0), np.zeros((0, 0)))
        # unknowns without a rate of their own leave rounding
        self._rates[np.abs(self._rates) <= ROUNDING * np.abs(self._rates).max(initial=0.0)] = 0.0
        self._B = [parts[name] @ X for name in ("B0", "B1")]
        try:
            rows = np.split(np.linalg.solve(X, rows), 3, axis=1)
        except np.linalg.LinAlgError:
            rows = [parts[f"R{power}"] for power in range(3)]  # no basis: the probe below shows it
        self._R = {power: rows[power] for power in range(3) if parts[f"R{power}"].any()}
        self.zeros = self._shift - 1.0 / self._rates[self._rates != 0]
        probe = np.array([1j * self._shift])
        exact, other = self._by_solves(probe)[0], self.condensed(probe)[0]
        if not np.abs(exact - other).max(initial=0.0) <= ALIKE * np.abs(exact).max(initial=0.0):
            self.condensed = self._by_solves  # motions that are hardly independent of each other

    def _by_solves(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """As `condensed`, with a factorisation at every place."""
        A, B, R, S = fluid_values(self._parts, np.asarray(s, complex)[:, None, None])
        sign, log = np.linalg.slogdet(S)
        return A - B @ np.linalg.solve(S, R), log + 1j * np.angle(sign)

    def stable(self, line: float = 0.0) -> np.ndarray:
        """Zeros of a stable polynomial that turns as det S(s) does, relative to a line; none of one unknown.

        They are those of the fluid alone, mirrored to the left of the line. What is divided by it varies as little as
        with a single unknown, however many the fluid has.
        """
        if self._rates.size < 2:
            return np.zeros(0, complex)
        zeros = self.zeros - line
        least = 1e-6 * np.abs(zeros).max(initial=0.0)
        return -np.maximum(np.abs(zeros.real), least) + 1j * zeros.imag

    def condensed(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """A - B S^-1 R at places, (p, m, m), and log det S, (p,); a zero of S that is met is moved by rounding."""
        s = np.asarray(s, complex)[:, None]
        away = (s - self._shift) * self._rates
        below = 1.0 + away
        below = np.where(np.abs(below) > MET * np.abs(away), below, MET * np.abs(away))
        s = s[..., None]
        left = (self._B[0] + s * self._B[1]) / below[:, None, :]
        coupling = self._A[0] + s * (self._A[1] + s * self._A[2])
        for power, part in self._R.items():
            coupling -= s**power * (left @ part)
        return coupling, self._log + np.log(below).sum(axis=1)


#: Share of the size of an eigenvalue below which its imaginary part is no oscillation: a crowd of creep that rounding
#: has split, or a motion whose damping ratio exceeds 0.995.
OVERDAMPED = 0.1


def edge_of(relaxation: Relaxation | None) -> float:
    """Growth rate right of which a real eigenvalue is clearly no creep, 1/s, negative; minus infinity without.

    A stiffness of which all relaxes creeps at the zeros of 1 + phi_g, the slowest of them left of -1/(tau_max (1 + sum
    of strengths)).
    """
    if relaxation is None:
        return -np.inf
    return float(-CLEAR / (relaxation.times.max() * (1.0 + relaxation.strengths.sum(axis=1).max())))


def apart_from_creep(pencil: CoupledPencil, values: np.ndarray) -> np.ndarray:
    """Mask of eigenvalues that oscillate, or lie clearly right of the creep."""
    values = np.asarray(values)
    return (np.abs(values.imag) > OVERDAMPED * np.abs(values)) | (values.real > edge_of(pencil.relaxation))
