"""The valve in motion: the residual of the coupled equations, traceable, and its directional derivatives.

    M(q) a + h(q, v) + alpha M v + beta K_s(q) v + f(q) - G(q) p = 0,     e = 0

with h the inertia quadratic in the velocities (turning directors), K_s the structure's own tangent, which has no part
of the contact of inner faces in f, p the station pressures of the unsteady flow through the areas A(q) with rates A' =
J v and A'' = J a + d2A[v, v], and e the flow law's own equations.

Inertia, flow and load are one jax function of the motion and of the parameters; the structure's force and forms come
from the element energy. Time steps and periodic motions evaluate the same equations by compiled loops.

Equation (T.15) of docs/theory.md.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from ..flow.law import FlowMotion, along
from ..shell.reference import SHAPE, SLOPE
from ..shell.rotation import director
from .outside import OutsideForms
from .valve import ValveModel

#: Parameters of the damping; those of the flow law come before them.
DAMPING = ("alpha", "beta")


class ValveResidual:
    """Residual of the equations of motion and its multilinear forms.

    Parameters
    ----------
    The residual is a vector (n + l,): forces, then the flow's own equations. A motion is a tuple (q, v, a, inner,
    inner_rate) with the flow's unknowns (l,), one number where there is one; parameters a mapping with alpha, beta and
    those of the flow law that have no default. Second and third derivatives are taken about motions with v = 0. Lip
    stops are piecewise linear and have none; contact of inner faces has those of the pieces of its law.

    Attributes
    ----------
    parameters : tuple of str
        Names of the parameters: those of the flow law, then alpha and beta.
    """

    def __init__(self, model: ValveModel):
        shell = model.shell
        self.model = model
        self.parameters = (*model.flow.names, *DAMPING)
        self._forces, self._inner = slice(model.size), (model.flow.inner,)
        self._outside: OutsideForms | None = None
        self._arrays = {
            "flow": model.flow,
            "quads": jnp.asarray(shell.mesh.quads),
            "nodes": jnp.asarray(shell.mesh.nodes),
            "free": jnp.asarray(np.flatnonzero(shell.dofs.free)),
            "directors": jnp.asarray(shell.mesh.directors),
            "frames": jnp.asarray(shell.mesh.frames),
            "mass": jnp.asarray(shell.inertia_integrals),
            "still": jnp.zeros(shell.dofs.free.shape),
            "stations": jnp.asarray(model.station_of_node),
            "loaded": jnp.asarray(model.loaded),
            "rows": jnp.asarray(model.mesh.rows),
            "offset": jnp.asarray(model.rows.offset),
        }

    def _shaped(self, motion) -> tuple:
        q, v, a, inner, inner_rate = motion
        return (q, v, a, *(np.reshape(np.asarray(x, float), self._inner) for x in (inner, inner_rate)))

    def _unit(self, name: str) -> dict:
        if name not in self.parameters:
            raise ValueError(f"The residual has no parameter '{name}'; it has {', '.join(self.parameters)}.")
        return {key: 1.0 if key == name else 0.0 for key in self.parameters}

    def _given(self, parameters) -> dict:
        return self.model.flow.values(parameters) | {name: float(parameters[name]) for name in DAMPING}

    def value(self, motion, parameters) -> np.ndarray:
        """Residual (n + l,)."""
        motion, parameters = self._shaped(motion), self._given(parameters)
        out = np.array(_value(motion, parameters, self._arrays))
        force, structure = self.model.structure(motion[0])
        force += self.model.contact_force(motion[0])
        out[self._forces] += force + parameters["beta"] * (self.model.shell.dofs.matrix(structure) @ motion[1])
        if self.model.outside is not None and np.any(motion[2]):
            density = self.model.case.outside.density(parameters["density"])
            out[self._forces] += density * self._added(motion[0], motion[2])
        return out

    def remainder_form(self, motion, parameters, *directions) -> np.ndarray:
        """Directional derivative (n + l,), along two or three motions, of all but the force of
        shell and weight and its damping; with contact and the added mass of fluid outside.
        """
        self._check_at_rest(motion)
        motion, parameters = self._shaped(motion), self._given(parameters)
        directions = tuple(map(self._shaped, directions))
        out = np.array(_form_of_remainder(motion, parameters, directions, self._arrays))
        if self.model.contact is not None:
            out[self._forces] += self.model.contact.form(motion[0], *(direction[0] for direction in directions))
        if self.model.outside is not None:
            if self._outside is None or not np.array_equal(self._outside.q, motion[0]):
                structure = self.model.shell.dofs.matrix(self.model.structure(motion[0])[1])
                self._outside = OutsideForms(self.model.outside, motion[0], structure)
            form = self._outside.second if len(directions) == 2 else self._outside.third
            density = self.model.case.outside.density(parameters["density"])
            out[self._forces] += density * form(*(direction[:3] for direction in directions))
        return out

    def parameter_slope(self, motion, parameters, name: str) -> np.ndarray:
        """Derivative (n + l,) with respect to a parameter, at v = 0."""
        self._check_at_rest(motion)
        motion, parameters = self._shaped(motion), self._given(parameters)
        return np.array(_parameter_slope(motion, parameters, self._unit(name), self._arrays))

    def mixed(self, motion, parameters, a, name: str) -> np.ndarray:
        """Derivative (n + l,) along a motion and with respect to a parameter, at v = 0."""
        self._check_at_rest(motion)
        motion, parameters, a = self._shaped(motion), self._given(parameters), self._shaped(a)
        out = np.array(_mixed(motion, parameters, a, self._unit(name), self._arrays))
        if name == "beta":
            _, structure = self.model.structure(motion[0])
            out[self._forces] += self.model.shell.dofs.matrix(structure) @ a[1]
        if name == "density" and self.model.case.outside.fluid == "same":
            out[self._forces] += self._added(motion[0], a[2])
        return out

    def _added(self, q, a) -> np.ndarray:
        """Inertia (n,) of a fluid of unit density outside; the part quadratic in the velocities is left out."""
        structure = self.model.shell.dofs.matrix(self.model.structure(q)[1])
        columns = self.model.outside.added_mass(q, structure).columns
        return columns @ (columns.T @ a)

    @staticmethod
    def _check_at_rest(motion) -> None:
        if np.any(motion[1]):
            raise ValueError("Multilinear forms are taken about a steady state: the velocities must vanish.")


def _expand(values, arrays):
    still = arrays["still"]
    return still.ravel().at[arrays["free"]].set(values).reshape(still.shape)


def _directors(nodal, arrays):
    return jax.vmap(director)(nodal[:, 3:5], arrays["directors"], arrays["frames"])


def _inertia(nodal, rate, acceleration, alpha, arrays):
    """Inertia and mass-proportional damping forces (nn, 5)."""
    spin = lambda x, v: jax.jvp(lambda y: _directors(y, arrays), (x,), (v,))[1]  # noqa: E731
    turning = spin(nodal, rate)
    turned = jax.jvp(spin, (nodal, rate), (rate, acceleration))[1] + alpha * turning
    moved = acceleration[:, :3] + alpha * rate[:, :3]
    quads = arrays["quads"]
    weighted = lambda k, field: jnp.einsum("eab,ebi->eai", arrays["mass"][:, k], field[quads])  # noqa: E731
    count = nodal.shape[0]
    force = jnp.zeros((count, 3)).at[quads].add(weighted(0, moved) + weighted(1, turned))
    moment = jnp.zeros((count, 3)).at[quads].add(weighted(1, moved) + weighted(2, turned))
    _, pull = jax.vjp(lambda y: _directors(y, arrays), nodal)
    return pull(moment)[0].at[:, :3].add(force)


def _pressure_force(nodal, nodal_pressure, arrays):
    x = (arrays["nodes"] + nodal[:, :3])[arrays["quads"]]
    basis = jnp.einsum("pac,eai->epci", SLOPE, x)
    p = jnp.einsum("pa,ea->ep", SHAPE, nodal_pressure[arrays["quads"]]) * arrays["loaded"][:, None]
    force = jnp.einsum("pa,ep,epi->eai", SHAPE, p, jnp.cross(basis[:, :, 0], basis[:, :, 1]))
    return arrays["still"].at[arrays["quads"], :3].add(force)


def _areas(nodal, arrays):
    points = (arrays["nodes"] + nodal[:, :3])[arrays["rows"]]
    x, y = points[..., 0], points[..., 1]
    return jnp.sum(0.5 * (y[:, 1:] + y[:, :-1]) * (x[:, 1:] - x[:, :-1]), axis=1) + arrays["offset"]


def _remainder(motion, parameters, arrays):
    """Everything but the structure's own force: inertia, mass damping, load and the flow's own equations."""
    q, v, a, inner, inner_rate = motion
    nodal, rate, acceleration = (_expand(field, arrays) for field in (q, v, a))
    areas = lambda x: _areas(x, arrays)  # noqa: E731
    opening = lambda x, r: jax.jvp(areas, (x,), (r,))  # noqa: E731
    (area, area_rate), (_, area_acceleration) = jax.jvp(opening, (nodal, rate), (rate, acceleration))
    passage = FlowMotion(area, area_rate, area_acceleration, inner, inner_rate)
    p, rest = arrays["flow"].equations(passage, parameters)
    load = _pressure_force(nodal, p[arrays["stations"]], arrays)
    force = _inertia(nodal, rate, acceleration, parameters["alpha"], arrays) - load
    return jnp.concatenate([force.ravel()[arrays["free"]], rest])


_value = jax.jit(_remainder)


@jax.jit
def _form_of_remainder(motion, parameters, directions, arrays):
    return along(lambda m: _remainder(m, parameters, arrays), *directions)(motion)


@jax.jit
def _parameter_slope(motion, parameters, unit, arrays):
    return along(lambda p: _remainder(motion, p, arrays), unit)(parameters)


@jax.jit
def _mixed(motion, parameters, a, unit, arrays):
    slope = lambda m: along(lambda p: _remainder(m, p, arrays), unit)(parameters)  # noqa: E731
    return along(slope, a)(motion)
