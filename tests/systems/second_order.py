"""A large mechanical system with a coupling of low rank, served by condensed solves.

M q'' + C q' + K q + stiff q^3 = mu G (H' q + tau H' q'), as B u' = F with u = (q, v). No matrix of
the full system is ever formed: A - s B is condensed to s^2 M + s C + K, one sparse
factorisation, and the coupling by the Woodbury identity.
"""

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from continuation.spectra import shift_invert_spectrum
from continuation.system import System


class CoupledChain(System):
    """Fixed chain of ``count`` unit masses; ``rank`` columns feed strains back as forces."""

    def __init__(self, count: int, rank: int = 3, near: complex = 0.0, damping: float = 0.05, delay: float = 5.0):
        self.count, self.size, self.near = count, 2 * count, near
        self.delay = delay
        one = np.ones(count)
        self.mass = sp.diags([one + 0.3 * np.sin(np.arange(count))], [0], format="csc")
        self.stiffness = (count / 20.0) ** 2 * sp.diags([-one[1:], 2 * one, -one[1:]], [-1, 0, 1], format="csc")
        self.damping = damping * self.mass + 1e-3 * self.stiffness
        x = (np.arange(count) + 0.5) / count
        self.feed = np.stack([np.sin((k + 1) * np.pi * x) for k in range(rank)], 1) / count
        self.read = np.stack([np.sin((k + 1) * np.pi * x + 0.3) for k in range(rank)], 1)

    def parts(self, u):
        return u[: self.count], u[self.count :]

    def _coupling(self, q, v):
        return self.feed @ (self.read.T @ (q + self.delay * v))

    def residual(self, u, mu):
        q, v = self.parts(u)
        force = -self.damping @ v - self.stiffness @ q - q**3 + 0.4 * q * v
        return np.concatenate([v, force + mu["mu"] * self._coupling(q, v)])

    def linear(self, u, mu):
        q, v = self.parts(u)
        stiffness = self.stiffness + sp.diags([3 * q**2 - 0.4 * v], [0])
        damping = self.damping - sp.diags([0.4 * q], [0])
        return _Condensed(self, stiffness.tocsc(), damping.tocsc(), mu["mu"])

    def d_parameter(self, u, mu, name):
        return np.concatenate([np.zeros(self.count), self._coupling(*self.parts(u))])

    def d2(self, u, mu, a, b):
        q, _ = self.parts(u)
        (aq, av), (bq, bv) = self.parts(a), self.parts(b)
        return np.concatenate([np.zeros(self.count), -6 * q * aq * bq + 0.4 * (aq * bv + av * bq)])

    def d3(self, u, mu, a, b, c):
        aq, bq, cq = (self.parts(x)[0] for x in (a, b, c))
        return np.concatenate([np.zeros(self.count), -6 * aq * bq * cq])

    def d2_parameter(self, u, mu, name, a):
        return self.d_parameter(a, mu, name)

    def spectrum(self, u, mu, count, near=None):
        return shift_invert_spectrum(self.linear(u, mu), count, self.near if near is None else near)


class _Condensed:
    """A = [[0, I], [-K + mu G H', -C + mu tau G H']], B = diag(I, M)."""

    def __init__(self, model, stiffness, damping, gain):
        self.model, self.k, self.c, self.gain = model, stiffness, damping, gain
        self.size = model.size
        self._zero = None

    def matvec(self, x):
        q, v = self.model.parts(x)
        return np.concatenate([v, -self.k @ q - self.c @ v + self.gain * self.model._coupling(q, v)])

    def rmatvec(self, x):
        a, b = self.model.parts(x)
        back = self.gain * self.model.read @ (self.model.feed.T @ b)
        return np.concatenate([-self.k.T @ b + back, a - self.c.T @ b + self.model.delay * back])

    def mass_matvec(self, x):
        q, v = self.model.parts(x)
        return np.concatenate([q, self.model.mass @ v])

    mass_rmatvec = mass_matvec

    def shifted(self, shift):
        return _CondensedSolver(self, complex(shift))

    @property
    def _unshifted(self):
        if self._zero is None:
            self._zero = self.shifted(0.0)
        return self._zero

    def solve(self, rhs):
        x = self._unshifted.solve(rhs)
        return x if np.iscomplexobj(rhs) else x.real

    def solve_transpose(self, rhs):
        x = self._unshifted.solve_transpose(rhs)
        return x if np.iscomplexobj(rhs) else x.real


class _CondensedSolver:
    def __init__(self, linear, s):
        self.linear, self.s, m = linear, s, linear.model
        self.lu = spla.splu((s**2 * m.mass + s * linear.c + linear.k).astype(complex).tocsc())
        self.factor = linear.gain * (1 + s * m.delay)
        small = np.eye(m.read.shape[1]) - self.factor * m.read.T @ self.lu.solve(m.feed.astype(complex))
        self.small = np.linalg.inv(small)

    def _dynamic(self, f, trans="N"):
        """Solve (s^2 M + s C + K - factor G H') q = f."""
        m = self.linear.model
        out, inn = (m.feed, m.read) if trans == "N" else (m.read, m.feed)
        small = self.small if trans == "N" else self.small.T
        q = self.lu.solve(np.asarray(f, complex), trans)
        return q + self.lu.solve(out.astype(complex), trans) @ (self.factor * small @ (inn.T @ q))

    def matvec(self, x):
        return self.linear.matvec(x) - self.s * self.linear.mass_matvec(x)

    def rmatvec(self, x):
        return self.linear.rmatvec(x) - self.s * self.linear.mass_rmatvec(x)

    def solve(self, rhs):
        # v = f + s q;  -(K + s C + s^2 M - ...) q = g + (C + s M - mu tau G H') f
        m, (f, g) = self.linear.model, self.linear.model.parts(rhs)
        push = g + self.linear.c @ f + self.s * (m.mass @ f)
        push = push - self.linear.gain * m.delay * (m.feed @ (m.read.T @ f))
        q = -self._dynamic(push)
        return np.concatenate([q, f + self.s * q])

    def solve_transpose(self, rhs):
        # a = g + (C + s M - mu tau G H')' b;  the first row then holds b alone.
        m, (f, g) = self.linear.model, self.linear.model.parts(rhs)
        b = -self._dynamic(f + self.s * g, "T")
        a = g + self.linear.c.T @ b + self.s * (m.mass @ b)
        a = a - self.linear.gain * m.delay * (m.read @ (m.feed.T @ b))
        return np.concatenate([a, b])
