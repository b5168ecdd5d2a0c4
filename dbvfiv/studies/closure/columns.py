"""Columns and tables of back-pressure results."""

from __future__ import annotations

from ...record.mesh import MeshData
from ...record.record import GrowingRecord, Record
from ...record.states import LAYERS, PATH_RESTART, state_table
from ...record.table import TEXT, Column, Shown, TableSpec

#: Tables: of the walk along back pressures, of the flow before it is turned back, of the turn in time.
STATES, PATH, BUCKLING, OPENED, REVERSAL = "states", "path", "buckling", "opened", "reversal"
#: Prefix of the tables of a walk with the other supports, for comparison.
COMPARED = "compared_"
#: Notes on classes of motion besides that of the path: lowest eigenvalues of one equilibrium, and a state that buckles.
LOWEST, BUCKLED_CLASS = "class stiffness", "class buckling"
#: Most stiffness eigenvalues that are followed; the largest value of closure.eigenvalues.
MOST_EIGENVALUES = 100

#: What a user reads off a state; the names are keys of the JSON output.
SUMMARY = (
    Column(
        "pressure",
        "Pa",
        "Back pressure, outside",
        shown=Shown("pressure", "kPa", 9, lambda s: f"{s.pressure / 1e3:.6g}"),
    ),
    Column(
        "closed",
        "",
        "Some section is shut",
        "bool",
        shown=Shown("closed", "", 7, lambda s: "yes" if s.closed else "no"),
    ),
    Column("sealed_length", "m", "Length along the axis on which sections are shut"),
    Column(
        "lip_seal",
        "m",
        "The part of it that begins at the lip",
        shown=Shown("sealed", "lip+joint mm", 12, lambda s: f"{s.lip_seal * 1e3:.1f}+{s.joint_seal * 1e3:.1f}"),
    ),
    Column("joint_seal", "m", "The rest, at the joint of duckbill and saddle and on the saddle"),
    Column("sealed_area", "m^2", "Area over which the inner faces press on each other, whole valve"),
    Column(
        "contact_front",
        "m",
        "How far from the lip the walls have met along the centre line",
        shown=Shown("front", "mm", 7, lambda s: f"{s.contact_front * 1e3:.1f}"),
    ),
    Column(
        "contact_force",
        "N",
        "Force between the two walls, whole valve",
        shown=Shown("contact", "N", 8, lambda s: f"{s.contact_force:.1f}"),
    ),
    Column("largest_contact_pressure", "Pa", "Largest contact pressure at a node"),
    Column("contact_nodes", "", "Nodes in contact", "i8"),
    Column("penetration", "m", "Deepest penetration of contact points beyond the plane"),
    Column("overlap", "m", "Deepest overlap of the inner faces"),
    Column(
        "least_opening",
        "m^2",
        "Smallest passage left, whole valve",
        shown=Shown(
            "opening left",
            "mm2 at z",
            14,
            lambda s: f"{s.least_opening * 1e6:.2f} at {s.least_opening_position * 1e3:.0f}",
        ),
    ),
    Column("least_opening_position", "m", "Where it is, from the lip"),
    Column("lip_opening", "m", "Full clear opening between the inner faces of both lips at x = z = 0"),
    Column("lip_displacement", "m", "Displacement in y of the mid-surface of one lip at x = z = 0"),
    Column(
        "max_displacement",
        "m",
        "Largest displacement of the mid-surface",
        shown=Shown(
            "displacement",
            "mm at z",
            14,
            lambda s: f"{s.max_displacement * 1e3:.2f} at {s.max_displacement_position[2] * 1e3:.0f}",
        ),
    ),
    Column("max_displacement_position", "m", "Where it occurs, position at rest"),
    Column(
        "largest_strain",
        "",
        "Largest elongation or shortening of a layer in its plane",
        shown=Shown("strain", "%", 7, lambda s: f"{s.largest_strain * 100:.2f}"),
    ),
    Column("largest_strain_layer", "", "The layer it occurs in", TEXT),
    Column("largest_stress", "Pa", "Largest von Mises stress of a layer"),
    Column("largest_stress_layer", "", "The layer it occurs in", TEXT),
    Column(
        "lowest_stiffness_eigenvalue",
        "1/s^2",
        "Lowest eigenvalue of the tangent stiffness against the mass",
        shown=Shown("stiffness", "1/s2", 10, lambda s: f"{s.lowest_stiffness_eigenvalue:.4g}"),
    ),
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
    Column(
        "residual",
        "",
        "Unbalanced force over pressure force",
        shown=Shown("residual", "", 9, lambda s: f"{s.residual:.1e}"),
    ),
    Column("rounding", "", "Relative residual that rounding alone explains"),
    Column("reason", "", "Why the iteration ended", TEXT),
    Column(
        "before_limit",
        "",
        "Not asked for: the last state before a limit",
        "bool",
        shown=Shown("", "", 1, lambda s: "last before the limit" if s.before_limit else ""),
    ),
)
#: Fields of a state.
FIELDS = (
    Column("nodal", "m, rad", "Displacements ux uy uz and two rotations of each node"),
    Column("opening", "m^2", "Passage of the computed part between the inner faces at each row"),
    Column("contact_pressure", "Pa", "Contact pressure at each node"),
    Column("gap", "m", "Height of the inner face above the closing plane at each node"),
    Column("stiffness_eigenvalues", "1/s^2", "Those nearest to zero, real parts; NaN behind those that were followed"),
)
#: What it takes to go on from a state.
RESTART = (
    Column("way/step", "Pa", "Load step to try next"),
    Column("way/slope", "m/Pa, rad/Pa", "Derivative of the displacements and rotations of each node by the pressure"),
    Column("way/multiplier", "Pa", "Contact multiplier of each node; 0 where there is none"),
    Column(
        "way/energy",
        "J",
        "Work, work of renewing multipliers, contact potential, strain energy, defect; number of equilibria in between",
    ),
    Column("way/path", "", "Rows of the path up to the state", "i8"),
    Column("way/buckling", "", "Rows of buckling states up to it", "i8"),
)
POINT = (
    Column("pressure", "Pa", "Back pressure"),
    Column("max_displacement", "m", "Largest displacement"),
    Column("contact_force", "N", "Force between the two walls, whole valve"),
    Column("least_opening", "m^2", "Smallest passage left, whole valve"),
    Column("sealed_length", "m", "Length on which sections are shut"),
    Column("lip_seal", "m", "The part of it that begins at the lip"),
    Column("contact_front", "m", "How far from the lip the walls have met along the centre line"),
    Column("overlap", "m", "Deepest overlap of the inner faces"),
    Column("lowest_eigenvalue", "1/s^2", "Lowest stiffness eigenvalue; NaN where arclength was followed"),
    Column("arclength", "", "Found by arclength", "bool"),
)
BUCKLED = (
    Column("pressure", "Pa", "Critical pressure"),
    Column("kind", "", "limit point or bifurcation", TEXT),
    Column("eigenvalue", "1/s^2", "Lowest stiffness eigenvalue in magnitude"),
    Column("nodal", "m, rad", "Displacements and rotations of each node"),
    Column("shape", "", "Buckling shape, displacements and rotations of each node"),
)
SAMPLE = (
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


def tables_of(mesh: MeshData) -> tuple[TableSpec, ...]:
    """Tables of a back-pressure result on a mesh."""
    walks = [table for prefix in ("", COMPARED) for table in _walk_tables(prefix, mesh)]
    opened = state_table(OPENED, mesh, PATH_RESTART)
    return (*walks, opened, TableSpec(REVERSAL, SAMPLE, chunk=256))


def _walk_tables(prefix: str, mesh: MeshData) -> tuple[TableSpec, ...]:
    nodes = len(mesh.nodes)
    shapes = {c.name: c.shape(mesh) for c in LAYERS} | {
        "max_displacement_position": (3,),
        "nodal": mesh.nodal_shape,
        "opening": (len(mesh.z),),
        "contact_pressure": (nodes,),
        "gap": (nodes,),
        "stiffness_eigenvalues": (MOST_EIGENVALUES,),
        "way/slope": mesh.nodal_shape,
        "way/multiplier": (nodes,),
        "way/energy": (6,),
    }
    return (
        TableSpec(prefix + STATES, (*SUMMARY, *FIELDS, *LAYERS, *RESTART), shapes),
        TableSpec(prefix + PATH, POINT),
        TableSpec(prefix + BUCKLING, BUCKLED, dict.fromkeys(("nodal", "shape"), mesh.nodal_shape)),
    )


def void_rows(record: GrowingRecord, table: str, first: int) -> None:
    """Leave out the rows of a table from one on: they were on the way to something that was not reached, and whoever
    goes on finds them again.
    """
    if record.rows(table) > first:
        record.note("void", table=table, start=first, stop=record.rows(table))


def valid_rows(record: Record, table: str) -> list[int]:
    """Numbers of the rows of a table that were not left out."""
    void = {
        row for note in record.notes("void") if note["table"] == table for row in range(note["start"], note["stop"])
    }
    return [row for row in range(record.rows(table)) if row not in void]
