"""The dynamic residual once more, traceable, for its higher directional derivatives.

Normal forms and sensitivities need derivatives that the compiled loops do not give. Inertia, flow and load of
`dynamics.dynamic_residual` are one jax function of the motion and of the parameters here; the structure's forms come
from the element energy.
"""

from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from ..case.parameters import SYSTEM_NAMES
from ..flow import Channel
from ..flow.channel import _pressure as channel_pressure
from ..shell.mass import mass_integrals
from ..shell.reference import SHAPE, SLOPE
from ..shell.rotation import director
from .valve import ValveModel

MOTION = ("q", "v", "a", "velocity", "velocity_rate")
PARAMETERS = SYSTEM_NAMES


class AnalyticResidual:
    """Residual of the equations of motion and its multilinear forms.

    Parameters
    ----------
    model : ValveModel with flow

    The residual is a vector (n + 1,): forces, then the outlet pressure. A motion is a tuple (q, v, a, velocity,
    velocity_rate), parameters a dict with the keys of `PARAMETERS`. Second and third derivatives are taken about
    motions with v = 0. Lip stops are piecewise linear and have none.
    """

    def __init__(self, model: ValveModel):
        if not isinstance(model.flow, Channel):
            raise ValueError("The analytic residual serves valves driven by flow, not by a uniform pressure.")
        shell = model.shell
        self.model = model
        self._static = (model.size, bool(model.flow.unsteady))
        self._arrays = {
            "quads": jnp.asarray(shell.mesh.quads),
            "nodes": jnp.asarray(shell.mesh.nodes),
            "free": jnp.asarray(np.flatnonzero(shell.dofs.free)),
            "directors": jnp.asarray(shell.mesh.directors),
            "frames": jnp.asarray(shell.mesh.frames),
            "mass": jnp.asarray(mass_integrals(shell.geometry, shell.section)),
            "stations": jnp.asarray(model.station_of_node),
            "loaded": jnp.asarray(model.loaded),
            "rows": jnp.asarray(model.mesh.rows),
            "offset": jnp.asarray(model.rows.offset),
            "step": jnp.asarray(model.flow.step),
            "floor": jnp.asarray(model.flow.floor),
        }

    def value(self, motion, parameters) -> np.ndarray:
        """Residual (n + 1,)."""
        out = np.array(_value(self._static, motion, parameters, self._arrays))
        force, structure = self.model.structure(motion[0])
        out[:-1] += force + parameters["beta"] * (self.model.shell.dofs.matrix(structure) @ motion[1])
        return out

    def second(self, motion, parameters, a, b) -> np.ndarray:
        """Second directional derivative (n + 1,) along two motions."""
        self._check_at_rest(motion)
        out = np.array(_second(self._static, motion, parameters, a, b, self._arrays))
        form = partial(_form, self.model.shell.second, motion[0])
        # form(a0, b0) + beta (form(a0, b1) + form(a1, b0)), in one evaluation where one of the motions has no velocity
        beta = parameters["beta"]
        out[:-1] += form(a[0] + beta * a[1], b[0] + beta * b[1]) - beta**2 * form(a[1], b[1])
        return out

    def third(self, motion, parameters, a, b, c) -> np.ndarray:
        """Third directional derivative (n + 1,) along three motions."""
        self._check_at_rest(motion)
        out = np.array(_third(self._static, motion, parameters, a, b, c, self._arrays))
        form = partial(_form, self.model.shell.third, motion[0])
        beta = parameters["beta"]
        out[:-1] += form(a[0], b[0], c[0] + beta * c[1]) + beta * (form(a[0], b[1], c[0]) + form(a[1], b[0], c[0]))
        return out

    def parameter_slope(self, motion, parameters, name: str) -> np.ndarray:
        """Derivative (n + 1,) with respect to a parameter, at v = 0."""
        self._check_at_rest(motion)
        return np.array(_parameter_slope(self._static, motion, parameters, _unit(name), self._arrays))

    def mixed(self, motion, parameters, a, name: str) -> np.ndarray:
        """Derivative (n + 1,) along a motion and with respect to a parameter, at v = 0."""
        self._check_at_rest(motion)
        out = np.array(_mixed(self._static, motion, parameters, a, _unit(name), self._arrays))
        if name == "beta":
            _, structure = self.model.structure(motion[0])
            out[:-1] += self.model.shell.dofs.matrix(structure) @ a[1]
        return out

    @staticmethod
    def _check_at_rest(motion) -> None:
        if np.any(motion[1]):
            raise ValueError("Multilinear forms are taken about a steady state: the velocities must vanish.")


def _form(form, q, *directions):
    """A multilinear form of the structure, which dominates the costs; rates of velocity, for instance, have no part in
    it.
    """
    return form(q, *directions) if all(np.any(direction) for direction in directions) else 0.0


def _unit(name: str) -> dict:
    if name not in PARAMETERS:
        raise ValueError(f"The residual has no parameter '{name}'; it has {', '.join(PARAMETERS)}.")
    return {key: jnp.asarray(1.0 if key == name else 0.0) for key in PARAMETERS}


def _expand(values, arrays):
    count = arrays["nodes"].shape[0]
    return jnp.zeros(5 * count).at[arrays["free"]].set(values).reshape(count, 5)


def _collect(element_forces, arrays):
    """Sum element forces (ne, 4, 5) at the nodes."""
    return jnp.zeros((arrays["nodes"].shape[0], 5)).at[arrays["quads"]].add(element_forces)


def _directors(nodal, arrays):
    return jax.vmap(director)(nodal[:, 3:], arrays["directors"], arrays["frames"])


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
    return _collect(jnp.pad(force, ((0, 0), (0, 0), (0, 2))), arrays)


def _areas(nodal, arrays):
    points = (arrays["nodes"] + nodal[:, :3])[arrays["rows"]]
    x, y = points[..., 0], points[..., 1]
    return jnp.sum(0.5 * (y[:, 1:] + y[:, :-1]) * (x[:, 1:] - x[:, :-1]), axis=1) + arrays["offset"]


def _remainder(static, motion, parameters, arrays):
    """Everything but the structure's own force: inertia, mass damping, load and outlet pressure."""
    _, unsteady = static
    q, v, a, velocity, velocity_rate = motion
    nodal, rate, acceleration = (_expand(field, arrays) for field in (q, v, a))
    areas = lambda x: _areas(x, arrays)  # noqa: E731
    opening = lambda x, r: jax.jvp(areas, (x,), (r,))  # noqa: E731
    (area, area_rate), (_, area_acceleration) = jax.jvp(opening, (nodal, rate), (rate, acceleration))
    p = channel_pressure(
        arrays["step"],
        arrays["floor"],
        parameters["storage"],
        unsteady,
        area,
        area_rate,
        area_acceleration,
        velocity,
        velocity_rate,
        parameters["inlet"],
        parameters["density"],
    )
    load = _pressure_force(nodal, p.at[0].set(0.0)[arrays["stations"]], arrays)
    force = _inertia(nodal, rate, acceleration, parameters["alpha"], arrays) - load
    return jnp.concatenate([force.ravel()[arrays["free"]], p[:1]])


def _along(function, *directions):
    for direction in directions:
        function = partial(lambda inner, v, u: jax.jvp(inner, (u,), (v,))[1], function, direction)
    return function


@partial(jax.jit, static_argnums=0)
def _value(static, motion, parameters, arrays):
    return _remainder(static, motion, parameters, arrays)


@partial(jax.jit, static_argnums=0)
def _second(static, motion, parameters, a, b, arrays):
    return _along(lambda m: _remainder(static, m, parameters, arrays), a, b)(motion)


@partial(jax.jit, static_argnums=0)
def _third(static, motion, parameters, a, b, c, arrays):
    return _along(lambda m: _remainder(static, m, parameters, arrays), a, b, c)(motion)


@partial(jax.jit, static_argnums=0)
def _parameter_slope(static, motion, parameters, unit, arrays):
    return _along(lambda p: _remainder(static, motion, p, arrays), unit)(parameters)


@partial(jax.jit, static_argnums=0)
def _mixed(static, motion, parameters, a, unit, arrays):
    slope = lambda m: _along(lambda p: _remainder(static, m, p, arrays), unit)(parameters)  # noqa: E731
    return _along(slope, a)(motion)
