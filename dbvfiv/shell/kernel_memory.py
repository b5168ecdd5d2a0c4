"""Compiled loops of walls that relax: what each group of layers answers by its slow law, and what its branches hold.

Arrays are by element and Gauss point: strains (ne, 4, 8), resultants of g groups (ne, 4, g, 8) and of b branches
(ne, 4, b, 8), ordered as `dbvfiv.shell.kernel_section` has them. Strains are total Lagrangian, so what a branch holds
can be integrated through the thickness once and for all.
"""

from __future__ import annotations

import numba
import numpy as np

from .kernel_rubber import FAST
from .kernel_section import add_point_stress, linear_response, numbers_of, strains_at


@numba.njit(cache=True, fastmath=FAST)
def slow_resultants(
    quads,
    nodes,
    q,
    director,
    reference,
    stiffness,
    points,
    constants,
    scales,
    member,
    strain_out,
    slow_out,
):
    """Fill strains (ne, 4, 8) and the slow law's resultants (ne, 4, g, 8) of each group; unknowns q (nn, 5).

    Parameters
    ----------
    stiffness : (g, 8, 8) array
        Of the linear layers of each group.
    points, constants, scales : (k, 2), (k, 7), (k,) arrays
        Of all points that carry rubber.
    member : (k,) int array
        The group of each of these points; negative for none.
    """
    thickness = reference[5]
    x = np.empty((4, 3))
    d = np.empty((4, 3))
    u = np.empty((3, 3))
    v = np.empty((3, 3))
    z = np.empty(16)
    e = np.empty(5)
    s = np.empty(5)
    for el in range(quads.shape[0]):
        numbers_of(el, quads[el], nodes, q, director, reference, x, d, u, v, z)
        h = thickness[el]
        for point in range(4):
            strain = strain_out[el, point]
            strains_at(el, point, reference, z, strain)
            slow = slow_out[el, point]
            for g in range(stiffness.shape[0]):
                linear_response(stiffness[g], h, strain, slow[g])
            for l in range(points.shape[0]):
                if member[l] < 0:
                    continue
                add_point_stress(points[l], constants[l], scales[l], h, strain, slow[member[l]], e, s)


# a function of its own without fast arithmetic, so that it has the same digits wherever it is called; said in so many
# words, as it would take over the arithmetic of whichever caller is compiled first
@numba.njit(fastmath=False)
def _hold(branches, slow, kept, gained, out):
    for i in range(8):
        out[i] = 0.0
    for b in range(branches.shape[0]):
        for i in range(8):
            out[i] += kept[b] * branches[b, i]
    for g in range(slow.shape[0]):
        for i in range(8):
            out[i] -= gained[g] * slow[g, i]


@numba.njit(cache=True)
def hold_resultants(branches, slow, kept, gained, out):
    """Fill out (ne, 4, 8): what branches (ne, 4, b, 8) keep of theirs by factors (b,), less factors (g,) of the slow
    law's resultants (ne, 4, g, 8).
    """
    for el in range(out.shape[0]):
        for point in range(4):
            _hold(branches[el, point], slow[el, point], kept, gained, out[el, point])


@numba.njit(cache=True, fastmath=FAST)
def advance_branches(
    branches,
    stretch,
    slow,
    slow_new,
    strain,
    strain_new,
    group,
    time,
    kept,
    gained,
    gained_by_group,
    now,
    area,
    out,
    stretch_out,
    held_out,
    work,
):
    """Fill branches (ne, 4, b, 8) and their stretches (ne, 4, j, 8) at the end of a step, and what `hold_resultants`
    would give at the end of another step of the same length (ne, 4, 8).

    Parameters
    ----------
    group, time : (b,) int arrays
        Group and relaxation time of each branch.
    kept, gained : (2, max(b, j)) arrays
        What stays of a branch, and the share of the change of resultants that it takes up; second row: of stretches.
    now : float
        Weight of the new resultants in the work.
    work : (2, g) array
        Is added to: work done against the branches of each group over the change of strains, and what they hold in the
        end, J.
    """
    change = np.empty(8)
    for el in range(slow.shape[0]):
        for point in range(4):
            weight = area[el, point]
            for i in range(8):
                change[i] = strain_new[el, point, i] - strain[el, point, i]
            for j in range(stretch.shape[2]):
                for i in range(8):
                    stretch_out[el, point, j, i] = kept[1, j] * stretch[el, point, j, i] + gained[1, j] * change[i]
            for b in range(branches.shape[2]):
                g = group[b]
                t = time[b]
                stay = kept[0, b]
                gain = gained[0, b]
                done = 0.0
                held = 0.0
                for i in range(8):
                    old = branches[el, point, b, i]
                    value = stay * old + gain * (slow_new[el, point, g, i] - slow[el, point, g, i])
                    out[el, point, b, i] = value
                    done += (old + now * (value - old)) * change[i]
                    held += value * stretch_out[el, point, t, i]
                work[0, g] += weight * done
                work[1, g] += 0.5 * weight * held
            _hold(out[el, point], slow_new[el, point], kept[0], gained_by_group, held_out[el, point])
