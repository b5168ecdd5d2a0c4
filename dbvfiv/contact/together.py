"""Contact of two walls that are mirror images and move together: what a contact force does when both turn.

In a motion that is antisymmetric about the plane of contact, opposite points keep their distance across it to first
order, slide along it by twice their own motion, and tilt together. With u the displacement of a node along the plane, d
the change of its director along the plane, which for a thin wall is minus the slope of both faces, and b its distance
from the face, the gap normal to the common face opens by

    -b d.d + 2 d.u      (second order, of both sides)

of which -F is the energy of a pair that is pressed by a force F; half of it belongs to each side. It leaves a rigid
rotation of the pressed pair free of forces. The faces are taken as flat and in the plane where they touch, and slide
without friction.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from ..shell import Shell
from .plane import PlaneContact


def together_blocks(contact: PlaneContact, nodal, directors, first, multiplier) -> tuple[np.ndarray, list[int]]:
    """Tangent (k, 4, 4) of each contact node and the columns (4) of its nodal unknowns that it belongs to.

    Parameters
    ----------
    nodal, directors, first : (nn, c), (nn, 3), (nn, 2, 3) arrays
        Nodal unknowns, directors and their derivatives.
    multiplier : (k,) array, Pa
    """
    along = [axis for axis in range(3) if axis != contact.axis]
    force = contact.state(nodal, directors, multiplier).force
    turn = first[contact.nodes][:, :, along].transpose(0, 2, 1)  # director along the plane by the rotations
    block = np.zeros((contact.count, 4, 4))
    block[:, 2:, 2:] = (force * contact.depth)[:, None, None] * (turn.transpose(0, 2, 1) @ turn)
    block[:, :2, 2:] = -force[:, None, None] * turn
    block[:, 2:, :2] = block[:, :2, 2:].transpose(0, 2, 1)
    return block, [*along, 3, 4]


def class_stiffness(
    contact: PlaneContact, nodal: np.ndarray, multiplier: np.ndarray, shell: Shell, apart: bool
) -> sp.csr_matrix:
    """Tangent (n, n) of a contact in a class of motion.

    Parameters
    ----------
    contact : PlaneContact
    nodal : (nn, c) array
        Nodal unknowns of the state.
    multiplier : (k,) array, Pa
    shell : Shell
        With the n unknowns of the class.
    apart : bool
        Whether the two walls move against each other, so that contact resists; where they move together it only turns.
    """
    directors, first, second = contact.shell.directors(nodal)
    if apart:
        block = contact.tangent_blocks(nodal, directors, first, second, multiplier)
        columns = [contact.axis, 3, 4]
    else:
        block, columns = together_blocks(contact, nodal, directors, first, multiplier)
    unknowns, width = shell.dofs.index[contact.nodes][:, columns], len(columns)
    rows = np.repeat(unknowns[:, :, None], width, axis=2)
    across = np.repeat(unknowns[:, None, :], width, axis=1)
    keep = (rows >= 0) & (across >= 0) & (block != 0)
    return sp.csr_matrix((block[keep], (rows[keep], across[keep])), shape=(shell.size, shell.size))
