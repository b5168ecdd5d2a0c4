"""Stress and tangent of incompressible rubbers in plane stress, in closed form for compiled loops: Mooney-Rivlin with
C10, C01, C11, powers of x = I1 - 3 by C20 and C30 (Yeoh), the knee m0 x0 (sqrt(1 + x/x0) - 1), and Ogden's terms.

The law is defined by its energy in `dbvfiv.materials`; this is its first and second derivative with respect to [E11,
E22, 2E12, 2E13, 2E23], checked against automatic differentiation of that energy.

Equation (T.6) of docs/theory.md.
"""

from __future__ import annotations

import numba
import numpy as np

from ..materials.energy import OGDEN_ANGLES, OGDEN_ELLIPSE, OGDEN_FOCI, OGDEN_FROM, OGDEN_SPREAD

FAST = {"contract", "reassoc", "arcp", "nsz"}
_COS, _SIN = np.cos(OGDEN_ANGLES), np.sin(OGDEN_ANGLES)


@numba.njit(fastmath=FAST, inline="always")
def _deformation(constants, e):
    """Right Cauchy-Green components, C33 and its gradient with respect to C11, C22, C12, C13, C23, and the derivatives
    of the energy by both invariants.
    """
    a = 1 + 2 * e[0]
    b = 1 + 2 * e[1]
    c = e[2]
    g = e[3]
    k = e[4]
    det = a * b - c * c
    inv = 1 / det
    n = b * g * g - 2 * c * g * k + a * k * k
    h = (1 + n) * inv
    i1 = (a + b - 2) + (h - 1)
    i2 = (det - 1) + (a + b) * h - g * g - k * k - 2
    w1 = constants[0] + constants[2] * i2
    w2 = constants[1] + constants[2] * i1
    h0 = (k * k - h * b) * inv
    h1 = (g * g - h * a) * inv
    h2 = 2 * (h * c - g * k) * inv
    h3 = 2 * (b * g - c * k) * inv
    h4 = 2 * (a * k - c * g) * inv
    return a, b, c, g, k, inv, h, h0, h1, h2, h3, h4, w1, w2


@numba.njit(fastmath=FAST, inline="always")
def first_invariant(e):
    """I1 - 3 of strains e (5,) without cancellation; see `dbvfiv.materials.energy`."""
    trace = 2 * (e[0] + e[1])
    det = 4 * e[0] * e[1] - e[2] * e[2]
    plane = 4 * (e[0] * e[0] + e[0] * e[1] + e[1] * e[1]) + e[2] * e[2]
    across = (1 + 2 * e[1]) * e[3] * e[3] - 2 * e[2] * e[3] * e[4] + (1 + 2 * e[0]) * e[4] * e[4]
    return (plane + trace * det + across) / (1 + trace + det)


@numba.njit(fastmath=FAST, inline="always")
def has_more(constants):
    """True where a rubber has terms beyond Mooney and Rivlin's.

    Loops leave these terms out where their constants are zero.
    """
    return constants[3] != 0.0 or constants[4] != 0.0 or constants[5] != 0.0


@numba.njit(fastmath=FAST, inline="always")
def i1_slopes(constants, e):
    """First and second derivative by I1 of the terms of C20, C30 and the knee."""
    c20, c30, m0 = constants[3], constants[4], constants[5]
    x = first_invariant(e)
    first = x * (2 * c20 + 3 * c30 * x)
    second = 2 * c20 + 6 * c30 * x
    if m0 != 0.0:
        stretched = 1 + x / constants[6]
        slope = 0.5 * m0 / np.sqrt(stretched)
        first += slope
        second -= 0.5 * slope / (constants[6] * stretched)
    return first, second


@numba.njit(fastmath=FAST)
def ogden_terms(constants, e, out):
    """Fill out (5,): derivatives of the energy of Ogden's terms by I1, I2, I1 I1, I1 I2, I2 I2; see
    `dbvfiv.materials.energy`.
    """
    out[:] = 0.0
    largest = 0.0
    for p in range(OGDEN_FROM, constants.shape[0], 2):
        if constants[p] != 0.0:
            largest = max(largest, abs(constants[p + 1]))
    if largest == 0.0:
        return
    i1 = first_invariant(e)
    trace = 2 * (e[0] + e[1])
    det = 4 * e[0] * e[1] - e[2] * e[2]
    b1 = 2 * e[1] * e[3] - e[2] * e[4]
    b2 = 2 * e[0] * e[4] - e[2] * e[3]
    gap = (det * (trace + det) + (e[3] + b1) * b1 + (e[4] + b2) * b2) / (1 + trace + det)
    third = 1 + i1 / 3
    inverse = 1 + (i1 + gap) / 3
    upper = np.log(third + 2 * np.sqrt(max(third * third - inverse, 0.0)))
    lower = -np.log(inverse + 2 * np.sqrt(max(inverse * inverse - third, 0.0)))
    half = max(0.5 * (upper - lower), min(OGDEN_FOCI, OGDEN_SPREAD / largest))
    s = min(OGDEN_ELLIPSE, 0.5 * np.arcsinh(2 * np.pi / half))
    along = half * np.cosh(s)
    across = half * np.sinh(s)
    for k in range(_COS.shape[0]):
        real = 0.5 * (upper + lower) + along * _COS[k]
        turn = across * _SIN[k]
        weight = complex(across * _COS[k], along * _SIN[k])
        z = np.exp(real) * complex(np.cos(turn), np.sin(turn))
        y = z - 1
        characteristic = y * y * y + z * (gap - i1 * y)
        size = characteristic.real * characteristic.real + characteristic.imag * characteristic.imag
        inv = z * complex(characteristic.real / size, -characteristic.imag / size)
        slope = 0j
        for p in range(OGDEN_FROM, constants.shape[0], 2):
            half_power = 0.5 * constants[p + 1]
            if constants[p] != 0.0:
                swing = half_power * turn
                power = constants[p] * np.exp(half_power * real) * complex(np.cos(swing), np.sin(swing))
                slope += 0.5 * power
        first = weight * slope * inv
        second = first * inv
        out[0] += (first * z).real
        out[1] -= first.real
        out[2] += (second * z * z).real
        out[3] -= (second * z).real
        out[4] += second.real
    out /= _COS.shape[0]


@numba.njit(fastmath=FAST, inline="always")
def _slopes(constants, e, w1, w2):
    """Derivatives of the energy by I1, I2, I1 I1, I1 I2, I2 I2, from the first two of Mooney and Rivlin's part."""
    w11, w12, w22 = 0.0, constants[2], 0.0
    if has_more(constants):
        w, v = i1_slopes(constants, e)
        w1 += w
        w11 += v
    if constants.shape[0] > OGDEN_FROM:
        o = np.empty(5)
        ogden_terms(constants, e, o)
        w1, w2, w11, w12, w22 = w1 + o[0], w2 + o[1], w11 + o[2], w12 + o[3], w22 + o[4]
    return w1, w2, w11, w12, w22


@numba.njit(fastmath=FAST, inline="always")
def rubber_stress(constants, e, s):
    """Fill the stress s (5,) for the parameters of a law and strains e (5,)."""
    a, b, c, g, k, inv, h, h0, h1, h2, h3, h4, w1, w2 = _deformation(constants, e)
    w1, w2, _, _, _ = _slopes(constants, e, w1, w2)
    r = a + b
    s[0] = 2 * (w1 * (1 + h0) + w2 * (b + h + r * h0))
    s[1] = 2 * (w1 * (1 + h1) + w2 * (a + h + r * h1))
    s[2] = w1 * h2 + w2 * (r * h2 - 2 * c)
    s[3] = w1 * h3 + w2 * (r * h3 - 2 * g)
    s[4] = w1 * h4 + w2 * (r * h4 - 2 * k)


@numba.njit(fastmath=FAST, inline="always")
def rubber_tangent(constants, e, s, t):
    """Fill stress s (5,) and the upper triangle of the tangent t (5, 5); arguments as `rubber_stress` has them."""
    a, b, c, g, k, inv, h, h0, h1, h2, h3, h4, w1, w2 = _deformation(constants, e)
    w1, w2, w11, w12, w22 = _slopes(constants, e, w1, w2)
    r = a + b
    d2 = -2 * c
    p0 = 1 + h0
    p1 = 1 + h1
    q0 = b + h + r * h0
    q1 = a + h + r * h1
    q2 = d2 + r * h2
    q3 = r * h3 - 2 * g
    q4 = r * h4 - 2 * k
    s[0] = 2 * (w1 * p0 + w2 * q0)
    s[1] = 2 * (w1 * p1 + w2 * q1)
    s[2] = w1 * h2 + w2 * q2
    s[3] = w1 * h3 + w2 * q3
    s[4] = w1 * h4 + w2 * q4
    # Hessian of h
    h00 = -2 * h0 * b * inv
    h01 = (-h0 * a - h1 * b - h) * inv
    h02 = -(h0 * d2 + h2 * b) * inv
    h03 = -h3 * b * inv
    h04 = (2 * k - h4 * b) * inv
    h11 = -2 * h1 * a * inv
    h12 = -(h1 * d2 + h2 * a) * inv
    h13 = (2 * g - h3 * a) * inv
    h14 = -h4 * a * inv
    h22 = (2 * h - 2 * h2 * d2) * inv
    h23 = (-2 * k - h3 * d2) * inv
    h24 = (-2 * g - h4 * d2) * inv
    h33 = 2 * b * inv
    h34 = -2 * c * inv
    h44 = 2 * a * inv
    w = w1 + w2 * r
    # derivatives of those of the energy by I1 (m) and by I2 (n), where p and q are those of both invariants
    m0, m1 = w11 * p0 + w12 * q0, w11 * p1 + w12 * q1
    m2, m3 = w11 * h2 + w12 * q2, w11 * h3 + w12 * q3
    m4 = w11 * h4 + w12 * q4
    n0, n1, n2, n3, n4 = (
        w12 * p0 + w22 * q0,
        w12 * p1 + w22 * q1,
        w12 * h2 + w22 * q2,
        w12 * h3 + w22 * q3,
        w12 * h4 + w22 * q4,
    )
    t[0, 0] = 4 * (w * h00 + w2 * 2 * h0 + p0 * m0 + q0 * n0)
    t[0, 1] = 4 * (w * h01 + w2 * (1 + h0 + h1) + p1 * m0 + q1 * n0)
    t[0, 2] = 2 * (w * h02 + w2 * h2 + h2 * m0 + q2 * n0)
    t[0, 3] = 2 * (w * h03 + w2 * h3 + h3 * m0 + q3 * n0)
    t[0, 4] = 2 * (w * h04 + w2 * h4 + h4 * m0 + q4 * n0)
    t[1, 1] = 4 * (w * h11 + w2 * 2 * h1 + p1 * m1 + q1 * n1)
    t[1, 2] = 2 * (w * h12 + w2 * h2 + h2 * m1 + q2 * n1)
    t[1, 3] = 2 * (w * h13 + w2 * h3 + h3 * m1 + q3 * n1)
    t[1, 4] = 2 * (w * h14 + w2 * h4 + h4 * m1 + q4 * n1)
    t[2, 2] = w * h22 - 2 * w2 + h2 * m2 + q2 * n2
    t[2, 3] = w * h23 + h3 * m2 + q3 * n2
    t[2, 4] = w * h24 + h4 * m2 + q4 * n2
    t[3, 3] = w * h33 - 2 * w2 + h3 * m3 + q3 * n3
    t[3, 4] = w * h34 + h4 * m3 + q4 * n3
    t[4, 4] = w * h44 - 2 * w2 + h4 * m4 + q4 * n4
