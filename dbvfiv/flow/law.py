"""Base class of flow laws: one traceable definition, and the methods that callers use.

A law relates m station pressures to the areas of a passage, their first two rates, and l unknowns of its own, which l
equations fix. `FlowLaw.equations` writes this down once, in jax. Steady flow and linearised operators follow from it by
differentiation, for any law; what follows is compiled once for each kind of law and number of stations, and areas,
parameters and the law's own numbers may change freely. Time steps evaluate the law thousands of times and have faster
forms of it (`dbvfiv.flow.stepping`), tested against it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from eigen.operator import FLUID_PARTS


class FlowMotion(NamedTuple):
    """A passage in motion and the law's own unknowns."""

    #: area, area_rate and area_acceleration: (m,); m2, m2/s, m2/s2, from the outlet to the inlet.
    area: Any
    area_rate: Any
    area_acceleration: Any
    #: inner and inner_rate: (l,); the law's unknowns and their rates.
    inner: Any
    inner_rate: Any

    @classmethod
    def still(cls, area, inner) -> FlowMotion:
        """A passage at rest; the arrays may be traced."""
        none = np.zeros(np.shape(area))
        return cls(area, none, none, inner, np.zeros(np.shape(inner)))


@dataclass(frozen=True)
class FlowParameter:
    """A number that a law depends on."""

    name: str
    unit: str
    meaning: str
    value: float | None = None  #: What it is unless given; without it, it must be given.


def above_floor(area, floor):
    """Area that stays above a floor: floor + softplus(area - floor), within 1e-8 of the area from twenty floors
    upwards; traceable.
    """
    return floor * (1.0 + jax.nn.softplus(area / floor - 1.0))


class Traceable:
    """An object that may be an argument of a compiled jax function.

    A subclass names its attributes that are numbers or arrays (`DATA`, other traceable objects among them) and those
    that decide which code is traced (`STATIC`, hashable). Traced code sees these attributes only. A function is
    compiled once for each class and choice of `STATIC`, whatever the numbers.
    """

    DATA: ClassVar[tuple[str, ...]] = ()
    STATIC: ClassVar[tuple[str, ...]] = ()

    def __init_subclass__(cls, **options):
        super().__init_subclass__(**options)
        jax.tree_util.register_pytree_node(cls, cls._flatten, cls._unflatten)

    def _flatten(self):
        return [getattr(self, name) for name in self.DATA], tuple(getattr(self, name) for name in self.STATIC)

    @classmethod
    def _unflatten(cls, static, data):
        made = object.__new__(cls)
        made.__dict__.update(zip(cls.DATA, data))
        made.__dict__.update(zip(cls.STATIC, static))
        return made

    def changed(self, **attributes):
        """Copy with other attributes."""
        made = copy(self)
        made.__dict__.update(attributes)
        return made


class FlowLaw(Traceable, ABC):
    """Pressures at the stations of a passage.

    A subclass gives `inner_names`, `parameters`, `count` and `equations`; the first inner unknown of a law with a fluid
    is the inlet velocity, m/s. Its steady flow is then found by Newton's
    method from `steady_start`; a law that knows it in closed form overrides `steady` by it.
    """

    inner_names: ClassVar[tuple[str, ...]] = ()  #: The law's own unknowns.
    floor: float = 0.0  #: Smallest area that the fluid sees, m2; 0 without such a floor.
    #: Pressure that inlet pressures work against, Pa: that at the far end downstream, and `level`. Station pressures
    #: are what the wall sees and not over it.
    back: float = 0.0
    #: Weight of the fluid between the levels of inlet and outlet, Pa; positive where the outlet is higher.
    level: float = 0.0
    #: (m,) or 0; pressure of the levels, Pa: what stands on the wall at each station where nothing flows against
    #: `back`, that of the fluid inside less that outside. It vanishes at the outlet.
    static: Any = 0.0
    #: Whether a fluid moves: its density matters, and small motions of the wall change the pressures.
    has_fluid: bool = True
    #: Whether rates matter; without, the steady law holds at every instant and the inner unknowns follow from the
    #: passage.
    unsteady: bool = True
    compressed: bool = False  #: Whether the fluid in the passage is compressed; pressures do not contain rates then.
    #: Of the fluid that equilibria are found with, kg/m3; it matters only to those of a viscous fluid.
    density: float = 1.0
    step: Any = 0.0  #: (m - 1,) or 0; distances of the stations, m, where the fluid between them has momentum.
    #: book_names and energy_names: what time steps keep of the fluid's energy: what became of it, and what it holds;
    #: see `step_books`.
    book_names: tuple[str, ...] = ()
    energy_names: tuple[str, ...] = ()
    sealed: bool = False  #: Whether this is the law of still fluid in front of a seal; see `shut`.

    @property
    @abstractmethod
    def count(self) -> int:
        """Number m of stations."""

    @property
    def inner(self) -> int:
        """Number l of the law's own unknowns and equations."""
        return len(self.inner_names)

    @property
    @abstractmethod
    def parameters(self) -> tuple[FlowParameter, ...]:
        """The numbers that the equations depend on, inlet pressure and density among them."""

    def sources(self, area, area_rate, inner, parameters: Mapping[str, Any]) -> Any:
        """Pressures (m,) and the law's own balances (l,) but for rates, over `scales`; traceable."""
        raise NotImplementedError(f"{type(self).__name__} is not given by sources and what is held.")

    def held(self, area, area_rate, inner, parameters: Mapping[str, Any]) -> Any:
        """Quantities (m + l,) whose rates pressures and balances contain, over `scales`; traceable."""
        return jnp.zeros(self.count + self.inner)

    def scales(self, area, parameters: Mapping[str, Any]) -> Any:
        """Factors (m + l,) that turn `sources` and rates of `held` into Pa; traceable."""
        return jnp.ones(self.count + self.inner)

    def equations(self, motion: FlowMotion, parameters: Mapping[str, Any]) -> tuple[Any, Any]:
        """Pressures (m,), Pa, and residuals (l,) of the law's own equations; traceable by jax.

        A pressure that an equation sets to zero is zero among the pressures; what is left of it is the residual. They
        are `sources` with the rates of `held`, which is what time steps need; a law that has no steps may give them
        directly.
        """
        area, rate, acceleration, inner, inner_rate = motion
        found = self.sources(area, rate, inner, parameters)
        if self.unsteady:
            held = lambda a, r, u: self.held(a, r, u, parameters)  # noqa: E731
            found = found + jax.jvp(held, (area, rate, inner), (rate, acceleration, inner_rate))[1]
        found = self.scales(area, parameters) * found
        return found[: self.count], found[self.count :]

    def at_rest(self, area, inner, parameters: Mapping[str, Any]) -> tuple[Any, Any]:
        """`equations` of a passage at rest with constant inner unknowns; traceable."""
        return self.changed(unsteady=False).equations(FlowMotion.still(area, inner), parameters)

    def steady_start(self, area, parameters: Mapping[str, Any]):
        """Initial guess of the steady inner unknowns (l,); traceable."""
        return jnp.ones(self.inner)

    def steady(self, area, parameters: Mapping[str, Any]) -> tuple[Any, Any]:
        """Pressures (m,) and inner unknowns (l,) of the steady flow; traceable. Not numbers where there is none."""
        return solve_steady(self, area, parameters)

    # -- a passage that faces in contact shut

    def shut(self, seal: int | None) -> FlowLaw:
        """The law of fluid that is still but for what the wall displaces in front of a seal, the last of the stations
        from the outlet on that faces shut; the law itself where there is none, or where it knows no such fluid.

        Its last balance is the discharge past the seal, whose rate vanishes.
        """
        return self

    def work_lengths(self, area: np.ndarray) -> np.ndarray:
        """Lengths (m,), m, over which pressures that moving fluid adds to those at rest in front of a seal do work on
        areas (m,), m2.
        """
        raise NotImplementedError(f"{type(self).__name__} has no still fluid in front of a seal.")

    def with_displaced(self, area: np.ndarray, area_rate: np.ndarray, inner: np.ndarray) -> np.ndarray:
        """Unknowns (l,) with the inlet velocity of what the wall displaces in front of a seal."""
        return inner

    # -- steps in time, see `dbvfiv.flow.stepping`

    def reversed(self) -> FlowLaw:
        """The law with a flow that may run backwards, as time steps need it."""
        return self

    def with_velocity(self, inner: np.ndarray, velocity: float) -> np.ndarray:
        """Unknowns (l,) of a steady flow with another inlet velocity, m/s, where that is free."""
        return inner

    def is_soft(self, density: float) -> bool:
        """True for a gas, which hits no wall as a liquid does."""
        return False

    def far_velocity(self, inner: np.ndarray, given: Mapping[str, float] | None = None) -> float:
        """Velocity at the far end of a line, m/s of the inlet's section, that mass flows with at the density around the
        jet, by the law's unknowns (l,) under given parameters.
        """
        return float(inner[0])

    def speeds_of(self, area, area_rate, inner, parameters):
        """Speeds (m,) at the stations, m/s; traceable."""
        return jnp.zeros(self.count)

    def first_carried(self, motion: FlowMotion, parameters):
        """State of `step_books` at the start of a motion, carried from step to step; traceable."""
        return jnp.zeros(0)

    def step_books(self, step, parameters):
        """Energies (books,), J of the part, by `book_names`, of a `dbvfiv.flow.stepping.BookStep`, and what the next
        one needs; traceable.
        """
        return jnp.zeros(0), jnp.zeros(0)

    def energies(self, area, inner, parameters):
        """Energies, J of the part, by `energy_names`; traceable."""
        return jnp.zeros(0)

    def resolved(self, given: Mapping[str, float]) -> float:
        """Frequency up to which waves of the fluid are resolved, Hz, under given parameters; infinite without any."""
        return np.inf

    # -- parameters

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(parameter.name for parameter in self.parameters)

    def values(self, given: Mapping[str, float]) -> dict[str, float]:
        """All parameters by name: those among the given conditions, which may hold others, the rest by default. Raises
        ValueError if a parameter without a default is not given.
        """
        found = {}
        for parameter in self.parameters:
            value = given.get(parameter.name, parameter.value)
            if value is None:
                raise ValueError(f"The flow needs a value of its parameter '{parameter.name}' ({parameter.meaning}).")
            found[parameter.name] = float(value)
        return found

    # -- evaluation

    def steady_pressure(self, area: np.ndarray, inlet: float) -> np.ndarray:
        """Pressures (m,), Pa, of steady flow driven by the inlet pressure, Pa; independent of the density of a fluid
        without viscosity.
        """
        return np.asarray(call_compiled("steady", self, area, self._driven(inlet))[0])

    def steady_operator(self, area: np.ndarray, inlet: float) -> tuple[np.ndarray, np.ndarray]:
        """Steady pressures (m,) and their derivative (m, m) with respect to the areas."""
        slope, _, pressure = _steady_operator(self, area, self._driven(inlet))
        return np.asarray(pressure), np.asarray(slope)

    def steady_slope(self, area: np.ndarray, inlet: float) -> np.ndarray:
        """Derivative (m,) of the steady pressures by the inlet pressure."""
        return np.asarray(_steady_operator(self, area, self._driven(inlet))[1])

    def _driven(self, inlet: float) -> dict[str, float]:
        """Parameters for steady pressures."""
        return self.values({"inlet": inlet, "density": self.density})

    def at_unit_density(self) -> dict[str, float]:
        """Parameters with which a fluid of unit density has the pressures of the own one, at speeds that are larger by
        the root of its density; but for the compressibility of a line.
        """
        return {}

    def steady_inner(self, area: np.ndarray, given: Mapping[str, float]) -> np.ndarray:
        """Inner unknowns (l,) of the steady flow under given parameters."""
        return np.asarray(call_compiled("steady", self, area, self.values(given))[1])

    def still(self, area: np.ndarray, given: Mapping[str, float]) -> np.ndarray:
        """Inner unknowns of the fluid at rest, (l,), or one velocity where there are none."""
        return np.zeros(max(1, self.inner))

    def inlet_velocity(
        self, area: np.ndarray, inlet: float, density: float, given: Mapping[str, float] | None = None
    ) -> float:
        """Steady inlet velocity, m/s: the first inner unknown of every law with a fluid; `given` are further
        parameters, as those of `at_unit_density`.
        """
        all_given = {**(given or {}), "inlet": inlet, "density": density}
        return float(self.steady_inner(area, all_given)[0]) if self.has_fluid else 0.0

    def steady_velocities(
        self, area: np.ndarray, inlet: float, density: float, given: Mapping[str, float] | None = None
    ) -> np.ndarray:
        """Steady velocities (m,) at all stations, m/s; zero without a fluid. `given` as for `inlet_velocity`.

        A fluid of another density than the law's own is compressed by a pressure as much as that is.
        """
        if not self.compressed:
            return self.velocities(area, self.inlet_velocity(area, inlet, density, given))
        own = self.own_velocities(self.steady_inner(area, self._driven(inlet)))
        return own * np.sqrt(self.density / density)

    def inlet_density(self, area: np.ndarray, inlet: float, density: float) -> float:
        """Density of the fluid at the inlet in steady flow, kg/m3; see `steady_densities`."""
        return float(self.steady_densities(area, inlet, density)[-1])

    def steady_densities(self, area: np.ndarray, inlet: float, density: float) -> np.ndarray:
        """Densities (m,) of the fluid at all stations in steady flow, kg/m3; `density` is that around the jet.

        It is compressed by a pressure as much as the law's own fluid is.
        """
        if not self.compressed:
            return np.full(self.count, float(density))
        return density * self.own_densities(self.steady_inner(area, self._driven(inlet)))

    def own_densities(self, inner: np.ndarray) -> np.ndarray:
        """Densities (m,) at all stations over that around the jet, by the law's own unknowns (l,)."""
        return np.ones(self.count)

    def own_velocities(self, inner: np.ndarray) -> np.ndarray | None:
        """Velocities (m,) at all stations, m/s, where they are among the law's own unknowns (l,); None where they
        follow from the passage.
        """
        return None

    def moving_velocities(self, area, area_rate, inner, given: Mapping[str, float]) -> np.ndarray:
        """Velocities (k, m) at all stations, m/s, in passages with areas and rates (k, m) and the law's unknowns (k, l)
        under given parameters.
        """
        parameters = self.values(given)
        return np.asarray(jax.vmap(lambda *at: self.speeds_of(*at, parameters))(area, area_rate, inner))

    def velocities(self, area: np.ndarray, velocity: float) -> np.ndarray:
        """Steady velocities (m,) of a fluid of constant density at all stations from the inlet velocity; zero without a
        fluid.
        """
        if not self.has_fluid:
            return np.zeros(self.count)
        open_ = self.open_area(area)
        return velocity * open_[-1] / open_

    def open_area(self, area):
        """Area that the fluid sees: it stays above the floor."""
        return self.floor * (1.0 + np.logaddexp(0.0, area / self.floor - 1.0)) if self.floor else area

    def evaluate(self, motion: FlowMotion, given: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray]:
        """Pressures (m,) and residuals (l,) of `equations`, as numpy arrays."""
        pressure, residual = call_compiled("equations", self, self._shaped(motion), self.values(given))
        return np.array(pressure), np.array(residual)

    def linearise(self, motion: FlowMotion, given: Mapping[str, float]) -> dict[str, np.ndarray]:
        """Derivatives of pressures (m,), Pa, and balances (l,) at a motion, by name: with a the area and u the inner
        disturbances

        p = (A0 + lambda A1 + lambda^2 A2) a + (B0 + lambda B1) u
        0 = (R0 + lambda R1 + lambda^2 R2) a + (S0 + lambda S1) u
        """
        parts = _linearised(self, self._shaped(motion), self.values(given))
        return {name: np.asarray(part) for name, part in zip(FLUID_PARTS, parts)}

    def linearise_still(self, area: np.ndarray, given: Mapping[str, float], inner=None) -> dict[str, np.ndarray]:
        """Derivatives at a passage at rest, in steady flow unless the inner unknowns are given; see `linearise`."""
        inner = self.steady_inner(area, given) if inner is None else inner
        return self.linearise(FlowMotion.still(np.asarray(area), np.asarray(inner, float)), given)

    def _shaped(self, motion: FlowMotion) -> FlowMotion:
        shape = (self.inner,)
        inner, rate = np.reshape(motion.inner, shape), np.reshape(motion.inner_rate, shape)
        return motion._replace(inner=inner.astype(float), inner_rate=rate.astype(float))


#: Newton steps within which a flow must be found, and the relative size of the last one; what rounding may leave of it,
#: where steps no longer fall.
_STEPS, _TOLERANCE, _ROUNDING = 60, 1e-11, 1e-9


def along(function, *directions):
    """The function of one argument (a pytree) that is the derivative of `function` along all directions."""
    for direction in directions:
        function = partial(lambda inner, v, u: jax.jvp(inner, (u,), (v,))[1], function, direction)
    return function


@partial(jax.jit, static_argnums=0)
def call_compiled(method: str, law, *given):
    """Answer of a method of a law, compiled for each kind of law and number of stations."""
    return getattr(law, method)(*given)


@jax.jit
def _linearised(law, motion, parameters):
    """Parts of `FlowLaw.linearise` in the order of `eigen.operator.FLUID_PARTS`."""
    pressure, residual = jax.jacfwd(lambda m: law.equations(m, parameters))(motion)
    return (*pressure, *residual)


@jax.jit
def _steady_operator(law, area, parameters):
    """Derivatives (m, m) and (m,) of the steady pressures by the areas and by the inlet pressure, and they (m,)."""

    def pressures(area, inlet):
        return (law.steady(area, {**parameters, "inlet": inlet})[0],) * 2

    slopes, found = jax.jacfwd(pressures, (0, 1), has_aux=True)(area, parameters["inlet"])
    return *slopes, found


def solve_steady(law, area, parameters):
    """Pressures (m,) and inner unknowns (l,) at which the law's equations are met in a passage at rest; traceable.

    Newton's method finds the unknowns. Not numbers where the search fails.
    """
    inner = jnp.zeros(0)
    if law.inner:
        still = jax.lax.stop_gradient((law, area, parameters))
        inner = find_root(partial(step_at_rest, *still), still[0].steady_start(*still[1:]))
        inner = with_derivatives(partial(step_at_rest, law, area, parameters), inner)
    return law.at_rest(area, inner, parameters)[0], inner


def step_at_rest(law, area, parameters, inner):
    """Step (l,) of Newton's method towards the steady inner unknowns; traceable."""
    return newton_step(lambda x: law.at_rest(area, x, parameters)[1], inner)


def with_derivatives(step_at, inner):
    """Unknowns (l,) after two more steps of Newton's method, which leave them where they are and make their derivatives
    by all that the steps depend on exact up to the third: each step doubles the order, as it does the digits;
    traceable.
    """
    return jax.lax.fori_loop(0, 2, lambda _, x: x + step_at(x), inner)


def newton_step(function, at):
    """Step of Newton's method from a place (l,) towards a zero (l,) of a function; traceable."""
    slope, value = jax.jacfwd(lambda x: (function(x),) * 2, has_aux=True)(at)
    return -jnp.linalg.solve(slope, value)


def find_root(step_at, start, least=0.0):
    """Zero (l,) by Newton's method, a step halved as long as it makes the next one longer; not numbers where it is not
    found; traceable.

    Parameters
    ----------
    step_at : callable
        Step of Newton's method from a place (l,).
    start : (l,) array
    least : float
        Length of a last step that is small enough whatever the size of the zero.
    """

    def small(inner, step, share):
        return jnp.linalg.norm(step) <= share * jnp.linalg.norm(inner) + least

    def advance(carried):  # a step is evaluated at one place of the code, which takes long to compile
        inner, step, fraction, count, _ = carried
        there = inner + fraction * step
        new = step_at(there)
        before, after = jnp.linalg.norm(step), jnp.linalg.norm(new)
        taken = (count < 0) | (fraction <= 1e-3) | (after <= before)
        stays = taken & (count >= 0) & small(there, step, _ROUNDING) & ~(after <= 0.5 * before)
        inner, step = jnp.where(taken, there, inner), jnp.where(taken, new, step)
        return inner, step, jnp.where(taken, 1.0, 0.5 * fraction), count + taken, stays

    def goes_on(carried):
        inner, step, _, count, stays = carried
        return (count < 0) | ((count < _STEPS) & ~stays & ~small(inner, step, _TOLERANCE))

    begin = start, jnp.zeros_like(start), jnp.ones(()), -1, False
    inner, step, _, _, stays = jax.lax.while_loop(goes_on, advance, begin)
    return jnp.where(stays | small(inner, step, _TOLERANCE), inner + step, jnp.nan)


class UniformLoad(FlowLaw):
    """A uniform pressure without flow: no inner unknowns, p = sign * P at every station.

    Parameters
    ----------
    count : int
        Number of stations.
    sign : +1 (inside) or -1 (outside)
    """

    DATA = ("sign",)
    STATIC = ("_count",)
    has_fluid = False
    unsteady = False

    def __init__(self, count: int, sign: float):
        self._count = int(count)
        self.sign = float(sign)

    @property
    def count(self) -> int:
        return self._count

    @property
    def parameters(self) -> tuple[FlowParameter, ...]:
        return (FlowParameter("inlet", "Pa", "pressure on the wall"),)

    def equations(self, motion, parameters):
        return jnp.full(self._count, self.sign * parameters["inlet"]), jnp.zeros(0)
