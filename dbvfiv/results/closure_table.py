"""Columns of back-pressure results, and their states as lines of a table for people."""

from __future__ import annotations

from typing import Any

from ..record.layout import TEXT, Column

#: What a user reads off a state; the names are keys of the JSON output.
SUMMARY = (
    Column("pressure", "Pa", "Back pressure, outside"),
    Column("closed", "", "Some section is shut", "bool"),
    Column("sealed_length", "m", "Length along the axis on which sections are shut"),
    Column("lip_seal", "m", "The part of it that begins at the lip"),
    Column("joint_seal", "m", "The rest, at the joint of duckbill and saddle and on the saddle"),
    Column("sealed_area", "m^2", "Area over which the inner faces press on each other, whole valve"),
    Column("contact_force", "N", "Force between the two walls, whole valve"),
    Column("largest_contact_pressure", "Pa", "Largest contact pressure at a node"),
    Column("contact_nodes", "", "Nodes in contact", "i8"),
    Column("contact_front", "m", "How far from the lip the walls have met along the centre line"),
    Column("penetration", "m", "Deepest penetration of contact points beyond the plane"),
    Column("overlap", "m", "Deepest overlap of the inner faces"),
    Column("least_opening", "m^2", "Smallest passage left, whole valve"),
    Column("least_opening_position", "m", "Where it is, from the lip"),
    Column("lip_opening", "m", "Full clear opening between the inner faces of both lips at x = z = 0"),
    Column("lip_displacement", "m", "Displacement in y of the mid-surface of one lip at x = z = 0"),
    Column("max_displacement", "m", "Largest displacement of the mid-surface"),
    Column("max_displacement_position", "m", "Where it occurs, position at rest"),
    Column("largest_strain", "", "Largest elongation or shortening of a layer in its plane"),
    Column("largest_strain_layer", "", "The layer it occurs in", TEXT),
    Column("largest_stress", "Pa", "Largest von Mises stress of a layer"),
    Column("largest_stress_layer", "", "The layer it occurs in", TEXT),
    Column("lowest_stiffness_eigenvalue", "1/s^2", "Lowest eigenvalue of the tangent stiffness against the mass"),
    Column("lowest_symmetric_eigenvalue", "1/s^2", "The same of its symmetric part"),
    Column("asymmetry", "", "Largest entry of K - K' over that of K"),
    Column("stable", "", "Whether the lowest stiffness eigenvalue is positive", "bool"),
    Column("beyond_limit", "", "Whether the state lies beyond a limit point", "bool"),
    Column("force_balance", "", "Sum of pressure, contact and support forces over the sum of their sizes"),
    Column("energy_balance", "", "Work less energies over work, along the path with its load steps"),
    Column("converged", "", "Whether the residual fell below the tolerance", "bool"),
    Column("iterations", "", "Newton iterations that led here from the state before", "i8"),
    Column("load_steps", "", "Load steps that led here from the state before", "i8"),
    Column("multiplier_updates", "", "Renewals of the contact multipliers", "i8"),
    Column("residual", "", "Unbalanced force over pressure force"),
    Column("rounding", "", "Relative residual that rounding alone explains"),
    Column("reason", "", "Why the iteration ended", TEXT),
)
#: Fields of a state.
FIELDS = (
    Column("nodal", "m, rad", "Displacements ux uy uz and two rotations of each node"),
    Column("opening", "m^2", "Passage of a quarter between the inner faces at each row"),
    Column("contact_pressure", "Pa", "Contact pressure at each node"),
    Column("gap", "m", "Height of the inner face above the closing plane at each node"),
    Column("stiffness_eigenvalues", "1/s^2", "Stiffness eigenvalues nearest to zero, real parts"),
)
PATH = (
    Column("pressure", "Pa", "Back pressure"),
    Column("max_displacement", "m", "Largest displacement"),
    Column("contact_force", "N", "Force between the two walls, whole valve"),
    Column("least_opening", "m^2", "Smallest passage left, whole valve"),
    Column("sealed_length", "m", "Length on which sections are shut"),
    Column("lip_seal", "m", "The part of it that begins at the lip"),
    Column("contact_front", "m", "How far from the lip the walls have met along the centre line"),
    Column("lowest_eigenvalue", "1/s^2", "Lowest stiffness eigenvalue; NaN where arclength was followed"),
    Column("arclength", "", "Found by arclength", "bool"),
)
BUCKLING = (
    Column("pressure", "Pa", "Critical pressure"),
    Column("kind", "", "limit point or bifurcation", TEXT),
    Column("eigenvalue", "1/s^2", "Lowest stiffness eigenvalue in magnitude"),
    Column("nodal", "m, rad", "Displacements and rotations of each node"),
    Column("shape", "", "Buckling shape, displacements and rotations of each node"),
)
OPENED = (
    Column("pressure", "Pa", "Static inlet pressure"),
    Column("lip_opening", "m", "Full clear opening between the inner faces of both lips at x = z = 0"),
    Column("lip_displacement", "m", "Displacement in y of the mid-surface of one lip at x = z = 0"),
    Column("outlet_area", "m^2", "Flow area at the lip, whole valve"),
    Column("mass_flow", "kg/s", "Mass flow, whole valve"),
)
#: What it takes to go on from a state, a row for each.
RESTART = (
    Column("step", "Pa", "Load step to try next"),
    Column("slope", "m/Pa, rad/Pa", "Derivative of the unknowns by the pressure"),
    Column("multiplier", "Pa", "Contact multipliers"),
    Column(
        "energy",
        "J",
        "Work, work of renewing multipliers, contact potential, strain energy, defect; number of equilibria in between",
    ),
    Column("path_rows", "", "Points of the path up to the state", "i8"),
    Column("buckling_rows", "", "Buckling states up to it", "i8"),
)
REVERSAL = (
    Column("time", "s", "Time"),
    Column("inlet_pressure", "Pa", "Pressure of the drive"),
    Column("lip_opening", "m", "Full clear opening between the inner faces of both lips at x = z = 0"),
    Column("lip_displacement", "m", "Displacement in y of the mid-surface of one lip at x = z = 0"),
    Column("least_opening", "m^2", "Narrowest passage between the inner faces, whole valve"),
    Column("mass_flow", "kg/s", "Mass flow through the lip, whole valve; negative backwards"),
    Column("lowest_pressure", "Pa", "Lowest pressure of the fluid in the valve"),
    Column("highest_pressure", "Pa", "Highest pressure of the fluid in the valve"),
    Column("contact_force", "N", "Force between the two walls, whole valve"),
    Column("penetration", "m", "Deepest penetration"),
)

_COLUMNS = (
    ("pressure", "kPa", 9, lambda s: f"{s.pressure / 1e3:.6g}"),
    ("closed", "", 7, lambda s: "yes" if s.closed else "no"),
    ("sealed", "lip+joint mm", 12, lambda s: f"{s.lip_seal * 1e3:.1f}+{s.joint_seal * 1e3:.1f}"),
    ("front", "mm", 7, lambda s: f"{s.contact_front * 1e3:.1f}"),
    ("contact", "N", 8, lambda s: f"{s.contact_force:.1f}"),
    ("opening left", "mm2 at z", 14, lambda s: f"{s.least_opening * 1e6:.2f} at {s.least_opening_position * 1e3:.0f}"),
    (
        "displacement",
        "mm at z",
        14,
        lambda s: f"{s.max_displacement * 1e3:.2f} at {s.max_displacement_position[2] * 1e3:.0f}",
    ),
    ("strain", "%", 7, lambda s: f"{s.largest_strain * 100:.2f}"),
    ("stiffness", "1/s2", 10, lambda s: f"{s.lowest_stiffness_eigenvalue:.4g}"),
    ("residual", "", 9, lambda s: f"{s.residual:.1e}"),
)


def _line(cells: list[str]) -> str:
    return " ".join(cell.rjust(column[2]) for cell, column in zip(cells, _COLUMNS)).rstrip()


#: Names and units above the table.
HEAD = (_line([column[0] for column in _COLUMNS]), _line([column[1] for column in _COLUMNS]))


def row_of(state: Any) -> str:
    """One line for a state (of a study or of a result)."""
    return _line([column[3](state) for column in _COLUMNS])
