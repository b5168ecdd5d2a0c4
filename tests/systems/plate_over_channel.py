"""A soft plate over a channel: a synthetic pencil of the size and sparsity of a shell model.

Four-node plates with five unknowns a node (two membrane displacements, deflection, two
rotations) on a regular grid, clamped at the inlet end, free at the outlet, coupled to a
one-dimensional flow whose stations are the rows of nodes. It makes a realistic pencil
without a shell program; nothing published is claimed for it.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from eigen import CoupledPencil

from .one_dimensional_flow import linearised_flow

GAUSS = np.array([-1.0, 1.0]) / np.sqrt(3.0)


def _shape(xi, eta):
    n = 0.25 * np.array([(1 - xi) * (1 - eta), (1 + xi) * (1 - eta), (1 + xi) * (1 + eta), (1 - xi) * (1 + eta)])
    dn = 0.25 * np.array([[-(1 - eta), (1 - eta), (1 + eta), -(1 + eta)], [-(1 - xi), -(1 + xi), (1 + xi), (1 - xi)]])
    return n, dn


def _element(dx, dz, young, poisson, thickness, density):
    plane = young / (1 - poisson**2) * np.array([[1, poisson, 0], [poisson, 1, 0], [0, 0, (1 - poisson) / 2]])
    shear = 5 / 6 * young / (2 * (1 + poisson)) * thickness
    stiffness, mass = np.zeros((20, 20)), np.zeros((20, 20))
    inertia = density * np.array([thickness] * 3 + [thickness**3 / 12] * 2)

    def gradients(xi, eta):
        n, dn = _shape(xi, eta)
        return n, dn[0] * 2 / dx, dn[1] * 2 / dz

    jacobian = dx * dz / 4
    for xi in GAUSS:
        for eta in GAUSS:
            n, nx, nz = gradients(xi, eta)
            membrane, bending = np.zeros((3, 20)), np.zeros((3, 20))
            membrane[0, 0::5], membrane[1, 1::5] = nx, nz
            membrane[2, 0::5], membrane[2, 1::5] = nz, nx
            bending[0, 3::5], bending[1, 4::5] = nx, nz
            bending[2, 3::5], bending[2, 4::5] = nz, nx
            stiffness += jacobian * (
                thickness * membrane.T @ plane @ membrane + thickness**3 / 12 * bending.T @ plane @ bending
            )
            for d in range(5):
                mass[d::5, d::5] += jacobian * inertia[d] * np.outer(n, n)
    n, nx, nz = gradients(0.0, 0.0)  # one point for the shear: no locking
    gamma = np.zeros((2, 20))
    gamma[0, 2::5], gamma[0, 3::5] = nx, n
    gamma[1, 2::5], gamma[1, 4::5] = nz, n
    stiffness += 4 * jacobian * shear * gamma.T @ gamma
    return stiffness, mass


def plate_over_channel(
    across: int = 28,
    along: int = 48,
    *,
    density: float = 10.0,
    storage: bool = False,
    alpha: float = 0.0,
    beta: float = 3e-3,
    follower: float = 0.02,
    inlet_velocity: float = 3.0,
    with_parts: bool = False,
):
    """Build the pencil.

    Parameters
    ----------
    across, along : int
        Elements across and along; 28 x 48 gives 6960 unknowns and 49 stations.
    density : float
        Of the fluid, kg/m3.
    alpha, beta : float
        Rayleigh damping on the symmetric stiffness.
    follower : float
        Size of an unsymmetric follower stiffness at the free end, relative to the plate's.
    with_parts : bool
        Return also the symmetric stiffness.
    """
    width, length = 0.13, 0.56
    nx, nz = across + 1, along + 1
    stiffness, mass = _element(width / across, length / along, 6e6, 0.49, 0.0144, 1300.0)
    node = np.arange(nx * nz).reshape(nz, nx)
    corners = np.stack([node[:-1, :-1], node[:-1, 1:], node[1:, 1:], node[1:, :-1]], -1).reshape(-1, 4)
    dof = (5 * corners[:, :, None] + np.arange(5)).reshape(-1, 20)
    rows = np.repeat(dof, 20, axis=1).ravel()
    cols = np.tile(dof, (1, 20)).ravel()
    count = dof.shape[0]
    n = 5 * nx * nz
    Ks = sp.csr_matrix((np.tile(stiffness.ravel(), count), (rows, cols)), (n, n))
    M = sp.csr_matrix((np.tile(mass.ravel(), count), (rows, cols)), (n, n))
    # follower pressure: deflection force from rotation, taken on the last rows only
    w = 5 * node + 2
    load = sp.lil_matrix((n, n))
    weight = follower * 6e6 * 0.0144**3 / length**2 * width / nx
    for k in range(nz - 4, nz):
        for i in range(nx):
            load[w[k, i], 5 * node[k, i] + 4] = weight
    # rows to areas and pressures to forces; the row weights differ, so G is not J^T
    x_weight = np.full(nx, width / across)
    x_weight[[0, -1]] *= 0.5
    z_weight = np.full(nz, length / along)
    z_weight[[0, -1]] *= 0.5
    station = np.repeat(np.arange(nz), nx)
    J = sp.csr_matrix((np.tile(x_weight, nz), (station, w.ravel())), (nz, n))
    G = sp.csr_matrix((np.repeat(z_weight, nx) * np.tile(x_weight, nz), (w.ravel(), station)), (n, nz))
    keep = np.ones(n, bool)
    keep[dof_of(node[0], range(5))] = False  # clamped inlet
    keep[dof_of(node[:, 0], (0, 3))] = False  # symmetry plane
    keep[dof_of(node[:, -1], (2,))] = False  # side edge held
    Ks, M, load = (x.tocsr()[keep][:, keep] for x in (Ks, M, load))
    J, G = J[:, keep].tocsr(), G[keep].tocsr()
    # opening tapers towards the outlet, so the flow speeds up
    stations = np.linspace(0.0, length, nz)
    area = width * np.linspace(0.04, 0.008, nz)
    flow = linearised_flow(stations, area, inlet_velocity, density, storage=storage, inlet_length=0.0)
    K = (Ks - load).tocsr()
    C = (alpha * M + beta * Ks).tocsr()
    pencil = CoupledPencil(M=M, C=C, K=K, G=G, J=J, **flow.keywords())
    return (pencil, Ks) if with_parts else pencil


def dof_of(nodes, components):
    """Unknowns of some components at some nodes, flat."""
    return (5 * np.asarray(nodes).ravel()[:, None] + np.asarray(list(components))).ravel()
