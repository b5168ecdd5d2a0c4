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

from .plane import PlaneContact


def together_blocks(contact: PlaneContact, nodal, directors, first, multiplier) -> tuple[np.ndarray, list[int]]:
    """Tangent (k, 4, 4) of each contact node and the columns (4) of its nodal unknowns that it belongs to.

    Parameters
    ----------
    nodal, directors, first : (nn, 5), (nn, 3), (nn, 2, 3) arrays
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
