"""Derivatives of an eigenvalue with respect to parameters of the load, the surroundings and the wall.

d lambda = - w^H dT x / (w^H T' x) with left and right vectors of the coupled pencil (`eigen.eigenvalue_derivative`).
The change of the pencil is taken through the equilibrium: parameters that move it are stepped by a small amount to
either side and the steady state is found anew. Left and right vectors are needed at the state itself only, so one mode
costs two warm-started equilibria for each parameter and no further eigenvalue search.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from eigen import CoupledPencil, Mode, Relaxation
from eigen.derivative import difference, eigenvalue_derivative

from ...case.parameters import DESIGN, PARAMETERS, SURROUNDINGS, Mu
from ...errors import CaseError, SolveError
from ...model import ValveModel, linearise
from ...model.newton import EquilibriumSolver, NewtonOptions
from ..stability.place import design_value, is_surrounding, redesigned, require_parameter


@dataclass(frozen=True)
class Sensitivity:
    """Derivative of one eigenvalue.

    Attributes
    ----------
    parameter : str
    value : float
        SI; angles in degrees.
    derivative : complex
        1/s per unit of the parameter: growth rate and angular frequency.
    """

    parameter: str
    value: float
    derivative: complex

    @property
    def growth_rate(self) -> float:
        """Change of the growth rate, 1/s per unit."""
        return self.derivative.real

    @property
    def frequency(self) -> float:
        """Change of the frequency, Hz per unit."""
        return self.derivative.imag / (2 * np.pi)

    @property
    def relative(self) -> complex:
        """Change of the eigenvalue for a change of the parameter by its own size, 1/s."""
        return self.derivative * self.value

    @property
    def per_percent(self) -> complex:
        """Change of the eigenvalue for one percent more of the parameter, 1/s."""
        return 0.01 * self.relative


def parameters_of(model: ValveModel) -> tuple[str, ...]:
    """Every parameter an eigenvalue of this valve can be differentiated by.

    Those of `dbvfiv.case.parameters` that it has, and the layers, which count from 1, inside to outside: "layer 3
    angle", "layer 1 thickness" (its share of the wall), "layer 1 mu_0" (a constant of its law).
    """
    names = [name for name in PARAMETERS if _has(model, name)]
    for i, layer in enumerate(model.shell.section.layers, 1):
        names += [f"layer {i} thickness", f"layer {i} angle"]
        names += [f"layer {i} {field.name}" for field in fields(layer.law)]
    return tuple(names)


def _has(model: ValveModel, name: str) -> bool:
    """True where a parameter of the table acts on the valve and has one value there."""
    if name in ("density", "storage"):
        return model.flow.has_fluid and model.flow.unsteady
    if name in ("angle", "strain"):
        return design_value(model.case, name) is not None
    try:
        require_parameter(model.case, name)
    except CaseError:
        return False
    return True


def unit_of(name: str) -> str:
    """Unit of the values of a parameter."""
    if name in PARAMETERS:
        return PARAMETERS[name].quantity.si
    _, quantity = _layer(name)
    if quantity.startswith(("nu", "poisson", "x_0")):
        return ""
    return {"thickness": "m", "angle": "deg", "density": "kg/m^3"}.get(quantity, "Pa")


def differentiate(
    model: ValveModel, q: np.ndarray, pressure: float, mu: Mu, mode: Mode, name: str, step: float = 1e-4
) -> Sensitivity:
    """Derivative of one eigenvalue of a steady state by one parameter.

    At an end of what a parameter may be, such as the strain level of 10 %, that towards its inside, to second order as
    central ones are. Strain levels are interpolated linearly between the tests: at one of those, 20 or 40 %, the
    derivative is the mean of both sides.

    Parameters
    ----------
    q : (n,) array
        The steady state at the inlet pressure, Pa.
    mode : eigen.Mode
        With left vectors (`SearchOptions(left=True)`).
    name : str
        Of `parameters_of`.
    step : float
        Relative size of the central differences of the pencil; of a parameter that is zero, its absolute size.

    Raises
    ------
    ValueError
        If a parameter does not exist or the mode has no left vector.
    SolveError
        If the steady state is lost beside its place.
    """
    known = parameters_of(model)
    if name not in known:
        raise ValueError(f"An eigenvalue cannot be differentiated by '{name}'; it can by {', '.join(known)}.")
    value = _value(model, pressure, mu, name)
    h = step * (abs(value) or 1.0)
    pencil = linearise(model, q, pressure).pencil(mu)

    def slope(low: float, high: float) -> complex:
        ends = (_pencil(model, q, pressure, mu, name, v) for v in (low, high))
        here, *ends = _with_common_times(pencil, *ends)
        return eigenvalue_derivative(here, mode, difference(*ends, high - low))

    inward = _inward(name, value, h)
    if inward == 0:
        return Sensitivity(name, value, slope(value - h, value + h))
    near, far = (slope(*sorted((value, value + inward * reach))) for reach in (h, 2 * h))
    return Sensitivity(name, value, 2 * near - far)


def _with_common_times(*pencils: CoupledPencil) -> list[CoupledPencil]:
    """Pencils whose relaxations, if any, have the same parts and times.

    A fitted series may leave out a time, and a factor of zero on the loss factors leaves none.
    """
    known = [pencil.relaxation for pencil in pencils if pencil.relaxation is not None]
    if not known:
        return list(pencils)
    times = np.unique(np.concatenate([relaxation.times for relaxation in known]))

    def common(relaxation: Relaxation | None) -> Relaxation:
        strengths = np.zeros((len(known[0].matrices), len(times)))
        if relaxation is None:
            return known[0].replace(strengths, times)
        strengths[:, np.searchsorted(times, relaxation.times)] = relaxation.strengths
        return relaxation.replace(strengths, times)

    return [replace(pencil, relaxation=common(pencil.relaxation)) for pencil in pencils]


def _inward(name: str, value: float, h: float) -> int:
    """+1 at the lower end of a parameter that ends there, -1 at the upper end, 0 elsewhere."""
    if (
        name.split()[-1] in ("mu_inf", "mu_0", "c", "c_3") and value < h
    ):  # constants of a softening layer, none negative
        return 1
    if name == "thickness" or name not in (*DESIGN, "loss_factor"):
        return 0
    row = PARAMETERS[name]
    return 1 if value - h < row.low else -1 if value + h > row.high else 0


def _layer(name: str) -> tuple[int, str]:
    _, number, quantity = name.split()
    return int(number) - 1, quantity


def _value(model, pressure, mu, name) -> float:
    if name == "pressure":
        return pressure
    if name in SURROUNDINGS:
        return Mu.of(model.case).at(**mu)[name]
    if name in DESIGN:
        return design_value(model.case, name)
    i, quantity = _layer(name)
    layer = model.shell.section.layers[i]
    return float(getattr(layer if quantity in ("thickness", "angle") else layer.law, quantity))


def _pencil(model, q, pressure, mu, name, value):
    """Pencil at the steady state with one parameter changed."""
    if name in SURROUNDINGS:
        mu = mu.at(**{name: value})
        if is_surrounding(model.case, name):
            return linearise(model, q, pressure).pencil(mu)
    changed = model
    if name == "pressure":
        pressure = value
    elif name in DESIGN or name in SURROUNDINGS:
        changed = ValveModel(redesigned(model.case, {name: value}))
    else:
        changed = ValveModel(model.case, _section(model.shell.section, name, value))
    result = EquilibriumSolver(changed, NewtonOptions(tolerance=1e-11)).solve(q, pressure)
    if not result.converged:
        raise SolveError(f"The steady state was lost with {name} at {value:.6g}: {result.reason}.")
    return linearise(changed, result.q, pressure).pencil(mu)


def _section(section, name, value):
    i, quantity = _layer(name)
    layer = section.layers[i]
    if quantity in ("thickness", "angle"):
        layer = replace(layer, **{quantity: value})
    else:
        layer = replace(layer, law=replace(layer.law, **{quantity: value}))
    return replace(section, layers=(*section.layers[:i], layer, *section.layers[i + 1 :]))
