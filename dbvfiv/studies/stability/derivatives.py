"""Derivatives of what a steady state does, by parameters of the load, the surroundings and the wall.

The state moves along q' = -K^-1 dr/dmu, with K the coupled tangent and dr/dmu a central difference of the residual at
fixed displacements; flow, opening and loss are differences along that line. An eigenvalue changes by

    d lambda = - w^H dT x / (w^H T' x)

with left and right vectors of the coupled pencil (`eigen.eigenvalue_derivative`) and dT the difference of the pencil
along the same line. Neither a further equilibrium nor a further eigenvalue search is needed: a parameter costs a
back-substitution and two linearisations, whatever the number of modes and of other quantities.

Of the fluid outside, dT x sees the added mass of x alone; the derivative of a sum of eigenvalues by all shapes comes
from one further solve, however many modes are in it (`flow.outside.ShapeDerivative`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property, partial

import numpy as np

from eigen.operator import CoupledPencil
from eigen.pairs import eigenvalue_derivative
from eigen.spectrum import Mode

from ...case.load import key_path
from ...case.parameters import DESIGN, PARAMETERS, SURROUNDINGS, Mu
from ...case.quantity import GRAVITY
from ...errors import CaseError, SolveError, is_accepted
from ...flow.outside.shape import ShapeDerivative
from ...materials.energy import MOONEY_RIVLIN
from ...model.dynamics import LinearisedState, linearise
from ...model.sizes import ValveSizes
from ...model.state import describe_state
from ...model.valve import ValveModel
from ..case import Case
from .place import design_value, is_surrounding, key_of, limits_of, number_of, redesigned, require_parameter

#: What a steady state does beside vibrating: names, units and words.
PERFORMANCE = {
    "flow": ("m^3/s", "Volume flow"),
    "opening": ("m^2", "Area between the lips"),
    "loss_coefficient": ("", "Head loss over the velocity head at the flange"),
    "mass": ("kg", "Mass of the wall"),
}
#: Keys of the shape that every valve can be changed by.
SHAPE = ("valve.duckbill_length", "valve.saddle_length", "valve.lip_half_width")
#: Share by which one-sided differences of one and two steps may differ, and share of a quantity, for a change of the
#: parameter by its own size, that they may besides.
ALIKE, ROUNDING = 0.1, 1e-4
#: Names of the inlet pressure, which a model takes beside its case.
_PRESSURE = "pressure", PARAMETERS["pressure"].key


@dataclass(frozen=True)
class Sensitivity:
    """Derivatives by one parameter."""

    parameter: str
    value: float  #: SI; angles in degrees.
    #: 1/s per unit of the parameter, of each mode, or each sum of them: growth rate and angular frequency.
    eigenvalues: tuple[complex, ...]
    performance: dict[str, float]  #: Per unit of the parameter, by the names of `PERFORMANCE`.

    @property
    def derivative(self) -> complex:
        """Derivative of the eigenvalue of the first mode, 1/s per unit."""
        return self.eigenvalues[0]

    @property
    def growth_rate(self) -> float:
        """Change of its growth rate, 1/s per unit."""
        return self.derivative.real

    @property
    def frequency(self) -> float:
        """Change of its frequency, Hz per unit."""
        return self.derivative.imag / (2 * np.pi)

    @property
    def relative(self) -> complex:
        """Change of that eigenvalue for a change of the parameter by its own size, 1/s."""
        return self.derivative * self.value

    @property
    def per_percent(self) -> complex:
        """Change of that eigenvalue for one percent more of the parameter, 1/s."""
        return 0.01 * self.relative

    def is_like(self, far: Sensitivity, sizes: np.ndarray) -> bool:
        """True where one-sided differences of one and of two steps differ as those of a smooth function do; `sizes`
        (k,) are those of eigenvalues and performance over that of the parameter.
        """
        own, other = (np.array([*one.eigenvalues, *one.performance.values()]) for one in (self, far))
        return not (np.abs(own - other) > ALIKE * np.abs(own) + ROUNDING * sizes).any()

    def towards(self, far: Sensitivity) -> Sensitivity:
        """Extrapolation of one-sided differences to step zero; `far` is that of twice the step."""
        eigenvalues = tuple(2 * near - other for near, other in zip(self.eigenvalues, far.eigenvalues))
        performance = {name: 2 * near - far.performance[name] for name, near in self.performance.items()}
        return Sensitivity(self.parameter, self.value, eigenvalues, performance)


def is_key(name: str) -> bool:
    """True for a key of the case, and not a parameter of all valves or a number of a layer."""
    return name not in PARAMETERS and not name.startswith("layer ")


def _another_valve(found: Sensitivity) -> SolveError:
    name, value = found.parameter, found.value
    return SolveError(f"Nothing can be differentiated by {name} at {value:g}: next to it is another valve.")


class Neighbourhood:
    """A steady state and those beside it.

    Parameters
    ----------
    q : (n,) array
        The steady state at the inlet pressure.
    pressure : float, Pa
    modes : sequence of eigen.Mode, optional
        With left vectors (`SearchOptions(left=True)`).
    step : float
        Relative size of the central differences; of a parameter that is zero, its absolute size.
    linear : LinearisedState, optional
        Of the state, where it is known.
    sums : (k, modes) complex array, optional
        Coefficients of sums of eigenvalues whose derivatives are asked, in place of those of each.
    """

    def __init__(
        self,
        model: ValveModel,
        q: np.ndarray,
        pressure: float,
        mu: Mu,
        modes: Sequence[Mode] = (),
        step: float = 2e-5,
        linear: LinearisedState | None = None,
        sums: np.ndarray | None = None,
    ):
        self.model, self.q, self.pressure, self.mu, self.modes, self.step = model, q, pressure, mu, tuple(modes), step
        self.sums = np.eye(len(self.modes)) if sums is None else np.asarray(sums)
        if linear is not None:
            self._linear = linear

    @cached_property
    def performance(self) -> dict[str, float]:
        """Values by the names of `PERFORMANCE`."""
        return _performance(self.model, self.q, self.pressure, self.mu)

    @cached_property
    def _factor(self):
        factor = self.model.factor()
        self.model.refactor(factor, self.model.tangent(self.q, self.pressure))
        return factor

    @cached_property
    def _linear(self) -> LinearisedState:
        return linearise(self.model, self.q, self.pressure)

    @cached_property
    def _pencil(self) -> CoupledPencil:
        return self._linear.pencil(self.mu)

    def slope(self, name: str) -> Sensitivity:
        """Derivatives by one parameter. Raises CaseError if a parameter does not exist, or its value beside this one is
        refused. Raises SolveError if there is no flow through the valve beside this one, or the valve jumps at the end
        of a parameter.

        Behind a pump the pressure follows its curve; by the pressure itself they are those of a static lift.

        At an end of what a parameter may be, such as the strain level of 10 %, those towards its inside, to second
        order as central ones are. Strain levels are interpolated linearly between the tests: at one of those, 20 or
        40 %, the derivative is the mean of both sides.
        """
        require_number(self.model, name)
        value = _value(self.model, self.pressure, self.mu, name)
        size = max(abs(value), self._least_size(name)) or 1.0
        spans = spans_about(self.model.case, name, value, self.step * size)
        near, *far = (self._between(name, value, *ends) for ends in spans)
        if not far:
            if is_key(name):
                self._require_smooth(near, size)
            return self._behind_pump(near)
        values = [mode.eigenvalue for mode in self.modes]
        sizes = np.array([*(np.abs(self.sums) @ np.abs(values) if values else ()), *self.performance.values()])
        if not near.is_like(*far, np.abs(sizes) / size):
            raise _another_valve(near)
        return self._behind_pump(near.towards(*far))

    def _require_smooth(self, near: Sensitivity, size: float) -> None:
        """Compare central differences of one and of two steps: a wall that ends on a joint of the bill jumps there.
        Raises SolveError if they differ.
        """
        step = 2.0 * self.step * size
        wide = self._between(near.parameter, near.value, near.value - step, near.value + step, eigenvalues=False)
        if not replace(near, eigenvalues=()).is_like(wide, np.abs([*self.performance.values()]) / size):
            raise _another_valve(near)

    def _least_size(self, name: str) -> float:
        """Size of a parameter, SI, by a share of which it is stepped at least: of a constant of a rubber, which may be
        small or 0, its shear modulus.
        """
        if unit_of(self.model.case, name) != "Pa" or not name.startswith(("layer ", "materials.")):
            return 0.0
        layers, by_name = self.model.shell.section.layers, not name.startswith("layer ")
        its = [one for one in layers if one.name == key_path(name)[1]] if by_name else [layers[_layer(name)[0]]]
        laws = [one.law for one in its]
        return max((law.small_strain_shear_modulus for law in laws if law.kind == MOONEY_RIVLIN), default=0.0)

    def _behind_pump(self, found: Sensitivity) -> Sensitivity:
        """Derivatives with the pressure that a pump gives at the flow that changes with a parameter."""
        pump, flows = self.model.pump, found.performance["flow"]
        if pump is None or found.parameter in _PRESSURE or not flows:
            return found
        by = self._by_pressure
        rise = pump.density * GRAVITY * pump.slope(self.performance["flow"])
        apart = rise * flows / (1.0 - rise * by.performance["flow"])
        eigenvalues = tuple(own + apart * other for own, other in zip(found.eigenvalues, by.eigenvalues))
        performance = {name: own + apart * by.performance[name] for name, own in found.performance.items()}
        return replace(found, eigenvalues=eigenvalues, performance=performance)

    @cached_property
    def _by_pressure(self) -> Sensitivity:
        return self.slope(_PRESSURE[0])

    def _between(self, name: str, value: float, low: float, high: float, eigenvalues: bool = True) -> Sensitivity:
        """Differences between two values of a parameter."""
        ends = [changed(self.model, self.pressure, self.mu, name, end) for end in (low, high)]
        places, moved = [self.q, self.q], self.tangent([end[:2] for end in ends], high - low)
        if moved is not None:
            places = [self.q + (end - value) * moved for end in (low, high)]
        below, above = (_performance(model, q, pressure, mu) for (model, pressure, mu), q in zip(ends, places))
        performance = {key: (above[key] - below[key]) / (high - low) for key in below}
        moves = self._eigenvalues(ends, places, high - low) if eigenvalues else ()
        return Sensitivity(name, value, moves, performance)

    def tangent(self, ends: Sequence[tuple[ValveModel, float]], apart: float) -> np.ndarray | None:
        """Derivative (n,) of the state from two valves with their inlet pressures, which lie `apart` in a parameter;
        None where nothing moves it.
        """
        if all(model is self.model and pressure == self.pressure for model, pressure in ends):
            return None
        first, second = (model.residual(self.q, pressure) for model, pressure in ends)
        return -self._factor.solve((second - first) / apart) if (second != first).any() else None

    def _eigenvalues(self, ends, places, apart: float) -> tuple[complex, ...]:
        if not self.modes:
            return ()
        below, above = (self._linearised(end, q).pencil(end[2]) for end, q in zip(ends, places))
        each = []
        for mode in self.modes:
            x = mode.eigenvalue, mode.q, mode.u
            (f, g), (f_below, g_below) = above.apply(*x), below.apply(*x)
            change = (f - f_below) / apart, (g - g_below) / apart
            try:
                each.append(eigenvalue_derivative(self._pencil, mode, change))
            except ValueError as error:
                raise SolveError(str(error)) from error
        found = self.sums @ np.array(each)
        if self.model.outside is not None and (places[0] is not places[1] or ends[0][0] is not ends[1][0]):
            found = found + self._resisting_change(ends, places) / apart
        return tuple(map(complex, found))

    def _resisting_change(self, ends, places) -> np.ndarray:
        """Differences (k,) that two shapes make to the sums by the resistance of the fluid outside."""
        below, above = (model.outside.all_panels(q) for (model, _, _), q in zip(ends, places))
        first, second = (model.outside.face.fluxes(model.nodal(q)) for (model, _, _), q in zip(ends, places))
        swept, found = second - first, []
        for slope, left, right in self._resisting:
            try:
                change = slope.between(below, above)
            except ValueError as error:
                raise SolveError(str(error)) from error
            moved = (swept @ left) * slope.pressures[1] + slope.pressures[0] * (swept @ right)
            found.append(change + moved.sum())
        return np.array(found)

    @cached_property
    def _resisting(self) -> list[tuple[ShapeDerivative, np.ndarray, np.ndarray]]:
        """Resistance of the fluid outside in each sum by the shape, with its motions (n, m), left ones and right."""
        density, factors = self.model.case.outside.density(self.mu["density"]), []
        for mode in self.modes:  # by the product of the left vector, the added mass of unit density and the right one
            force = density * mode.eigenvalue**2 * mode.left_q / np.vdot(mode.left_q, mode.left_q).real
            factors.append(eigenvalue_derivative(self._pencil, mode, (force, 0.0 * mode.u)))
        left = np.stack([mode.left_q.conj() for mode in self.modes], axis=1)
        right, found = np.stack([mode.q for mode in self.modes], axis=1), []
        for row in self.sums * np.array(factors):
            used = np.flatnonzero(row)
            motions = left[:, used], right[:, used] * row[used]
            found.append((self.model.outside.shape_derivative(self.q, *motions), *motions))
        return found

    def _linearised(self, end, q: np.ndarray):
        """Linearised state beside this one, with the added mass of this one."""
        model, pressure, _ = end
        if model is self.model and pressure == self.pressure:
            return self._linear
        return linearise(model, q, pressure, added=self._linear.added)

    def resisting(self, model: ValveModel, q: np.ndarray, motions: np.ndarray) -> np.ndarray:
        """Forces (n, k) of a fluid of unit density outside on accelerations (n, k) at a state beside this one."""
        return model.outside.resistance(q, motions, self._panels)

    @cached_property
    def _panels(self):
        return self.model.outside.panels(self.q)


def _performance(model: ValveModel, q: np.ndarray, pressure: float, mu: Mu) -> dict[str, float]:
    """Values by the names of `PERFORMANCE`, the flow in the fluid of the parameter point; NaN for those of a flow where
    nothing flows.
    """
    known = {"converged": True, "iterations": 0, "load_steps": 0, "residual": 0.0, "rounding": 0.0, "reason": ""}
    state = describe_state(model, q, pressure, **known)
    loss = state.hydraulics.loss_coefficient if state.hydraulics else np.nan
    mass = ValveSizes.of(model).wall_mass
    flow = state.volume_flow_of(mu["density"])
    return dict(zip(PERFORMANCE, (flow, state.outlet_area, loss, mass)))


def parameters_of(model: ValveModel) -> tuple[str, ...]:
    """Every parameter that derivatives are taken by unasked.

    Those of `dbvfiv.case.parameters` that the valve has, lengths of its shape, and the layers, which count from 1,
    inside to outside: "layer 3 angle", "layer 1 thickness" (its share of the wall), "layer 1 mu_0" (a constant of its
    law, except the series of moduli and exponents of an Ogden rubber).
    """
    names = [name for name in PARAMETERS if _has(model, name)]
    if model.case.valve.key_points is None:
        names += SHAPE
    for i, layer in enumerate(model.shell.section.layers, 1):
        names += [f"layer {i} thickness", f"layer {i} angle"]
        single = (field.name for field in fields(layer.law) if not isinstance(getattr(layer.law, field.name), tuple))
        names += [f"layer {i} {name}" for name in single]
    return tuple(names)


def require_number(model: ValveModel, name: str) -> None:
    """Refuse what is neither of `parameters_of` nor a key of the case that holds one number. Raises CaseError."""
    known = parameters_of(model)
    if name in ("density", PARAMETERS["density"].key) and model.pump is not None:
        require_parameter(model.case, "density")
    if name not in known:
        try:
            key_of(model.case, name, "sensitivity.of")
        except CaseError:
            raise CaseError(
                f"sensitivity.of names {name!r}, by which nothing of this valve can be differentiated; it can by "
                f"{', '.join(known)}, or a key of the case that has a number, such as valve.flange_length.",
                key="sensitivity.of",
            ) from None


def _has(model: ValveModel, name: str) -> bool:
    """True where a parameter of the table acts on the valve and has one value there."""
    if name == "density":
        return model.flow.has_fluid and model.pump is None
    if name == "storage":
        return model.flow.has_fluid and model.flow.unsteady and not model.case.is_compressed
    if name in ("angle", "strain", "sealing"):
        return design_value(model.case, name) is not None
    return is_accepted(lambda: require_parameter(model.case, name))


def unit_of(case: Case, name: str) -> str:
    """Unit of the values of a parameter."""
    if name in PARAMETERS:
        return PARAMETERS[name].quantity.si
    if not name.startswith("layer "):
        return key_of(case, name, "sensitivity.of")[0].si
    _, quantity = _layer(name)
    if quantity.startswith(("nu", "poisson", "x_0")):
        return ""
    return {"thickness": "m", "angle": "deg", "density": "kg/m^3"}.get(quantity, "Pa")


def spans_about(case: Case, name: str, value: float, h: float) -> list[tuple[float, float]]:
    """Pairs of values that a derivative by a parameter is taken between: one, a step h to both sides; at an end of what
    the parameter may be two, of one step and of two towards its inside, twice the first difference less the second.
    """
    inward = _inward(case, name, value, h)
    if inward == 0:
        return [(value - h, value + h)]
    return [(min(value, end), max(value, end)) for end in (value + inward * h, value + 2 * inward * h)]


def _inward(case: Case, name: str, value: float, h: float) -> int:
    """+1 at the lower end of a parameter that ends there, -1 at the upper end, 0 elsewhere, and for keys whose lower
    end is none of the parameter's values, such as a line of no length.
    """
    if (
        name.split()[-1] in ("mu_inf", "mu_0", "c", "c_3") and value < h
    ):  # constants of a softening layer, none negative
        return 1
    if is_key(name) and all(row.low_included for row in PARAMETERS.values() if row.key == name):
        h *= 2.0  # as far as the wider of both differences
        low, high = limits_of(number_of(case, name, "sensitivity.of")[0], name)
        if low <= value - h and value + h <= high:  # rules between keys end it too
            below, above = (is_accepted(partial(redesigned, case, {name: end})) for end in (value - h, value + h))
            return above - below
    elif name != "thickness" and name in (*DESIGN, "loss_factor"):
        low, high = PARAMETERS[name].low, PARAMETERS[name].high
    else:
        return 0
    return 1 if value - h < low else -1 if value + h > high else 0


def _layer(name: str) -> tuple[int, str]:
    _, number, quantity = name.split()
    return int(number) - 1, quantity


def _value(model, pressure, mu, name) -> float:
    if name in _PRESSURE:
        return pressure
    if name in SURROUNDINGS:
        return getattr(Mu.of(model.case).at(**mu), name)  # of a pipe without length 0
    if name in DESIGN:
        return design_value(model.case, name)
    if not name.startswith("layer "):
        return key_of(model.case, name, "sensitivity.of")[1]
    i, quantity = _layer(name)
    layer = model.shell.section.layers[i]
    return float(getattr(layer if quantity in ("thickness", "angle") else layer.law, quantity))


def changed(model: ValveModel, pressure: float, mu: Mu, name: str, value: float) -> tuple[ValveModel, float, Mu]:
    """Valve, inlet pressure and parameter point with one parameter changed; the same model where that stays. Raises
    CaseError for a value that the case does not allow.
    """
    case = model.case
    if name in _PRESSURE:
        return model, value, mu
    if name in SURROUNDINGS and is_surrounding(case, name):
        return model, pressure, mu.at(**{name: value})
    if name.startswith("layer "):
        return model.with_section(_section(model.shell.section, name, value)), pressure, mu
    new = ValveModel(redesigned(case, {name: value}))
    before, after = Mu.of(case), Mu.of(new.case)  # a key of one piece of the line moves the length of the whole
    moved = {each: getattr(after, each) for each in SURROUNDINGS if each in mu}
    return new, pressure, mu.at(**{each: own for each, own in moved.items() if own != getattr(before, each)})


def _section(section, name, value):
    i, quantity = _layer(name)
    layer = section.layers[i]
    if quantity in ("thickness", "angle"):
        layer = replace(layer, **{quantity: value})
    else:
        layer = replace(layer, law=replace(layer.law, **{quantity: value}))
    return replace(section, layers=(*section.layers[:i], layer, *section.layers[i + 1 :]))
