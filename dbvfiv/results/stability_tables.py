"""Columns of the tables in which onset and map results are kept."""

from __future__ import annotations

from ..record.layout import TEXT, Column

ONSETS = (
    Column("value", "of the parameter", "Where the eigenvalue reaches the imaginary axis."),
    Column("frequency", "Hz", "Frequency there; 0 for a real eigenvalue."),
    Column("growth_rate", "1/s", "Growth rate left over at the value."),
    Column("gains", "", "Whether the mode becomes unstable as the parameter grows.", "?"),
    Column("edge", "", "Whether no other mode is unstable there.", "?"),
    Column("confirmed", "", "Whether direct eigenvalues and independent counts on both sides agree with it.", "?"),
    Column("criticality", "", "super, sub or degenerate; empty where it is not known.", TEXT),
    Column(
        "first_lyapunov_coefficient",
        "1/s",
        "For eigenvectors of unit norm in displacements, velocities and inlet velocity.",
    ),
    Column("crossing_speed", "1/s per unit", "Derivative of the growth rate with respect to the parameter."),
    Column("uncertainty", "of the parameter", "From a second mesh by Richardson's rule with second order."),
    Column("coarse_value", "of the parameter", "The onset on the second mesh."),
    Column("sides/value", "of the parameter", "Where it was confirmed, below and above."),
    Column("sides/growth_rate", "1/s", "Growth rate of the crossing mode there, from the full pencil."),
    Column("sides/frequency", "Hz", "Its frequency there."),
    Column("sides/leading_growth_rate", "1/s", "Growth rate of the leading mode there."),
    Column("sides/unstable_count", "", "Unstable eigenvalues there, by the spectrum.", "i4"),
    Column("sides/unstable_count_independent", "", "The same by the argument principle.", "i4"),
    Column("note", "", "What else there is to say.", TEXT),
    Column("bracket", "of the parameter", "Neighbouring values of the scan that it lies between."),
    Column("ahead", "", "Modes that grow faster there.", "i4"),
)
SCAN = (
    Column(
        "value",
        "of the parameter",
        "Values of the scan, those of narrow tongues and of the search for onsets included.",
    ),
    Column("growth_rates", "1/s", "Of the leading modes."),
    Column("frequencies", "Hz", "Of the leading modes."),
    Column("mesh", "", "0 for the mesh of the case, 1 for the coarser one.", "i4"),
    Column("failure", "", "Why there is no state; empty if there is one.", TEXT),
    Column("certified", "", "Whether an independent count agrees with the unstable modes there.", "?"),
)
MAP = (
    Column("value", "of the parameter across", "Value that the cells of this row of the table share."),
    Column("level", "", "0 on the grid, more for columns put between its own.", "i4"),
    Column("growth_rate", "1/s", "Of the leading mode, for each continuity law and each value of the parameter along."),
    Column("frequency", "Hz", "Of the leading mode."),
    Column("second", "1/s", "Growth rate of the next mode."),
    Column("unstable", "", "Unstable eigenvalues by the spectrum, conjugates counted apart; -1 in gaps.", "i4"),
    Column("counted", "", "The same by the argument principle.", "i4"),
    Column("certified", "", "Whether both counts agree and the leading eigenvalue is accurate.", "?"),
    Column("how", "", "0 on the small model, 1 with the full pencil, 2 a gap.", "i4"),
    Column("onset_count", "", "Onsets along this column.", "i4"),
    Column("error", "", "Largest estimated relative error of a leading eigenvalue."),
    Column("failure", "", "Why there is no column.", TEXT),
    Column("seconds", "s", "Processor time."),
)
MAP_ONSETS = (
    Column("across", "of the parameter across", "Column it lies on."),
    Column("law", "", "Number of the continuity law.", "i4"),
    Column("along", "of the parameter along", "Where a mode is neutral."),
    Column("frequency", "Hz", "Its frequency."),
    Column("direction", "", "+1 where the mode becomes unstable along the column, -1 where it ceases to be.", "i4"),
    Column("residual", "", "Growth rate over the size of the eigenvalue that the full matrices leave there."),
)
CURVE_POINTS = (
    Column("curve", "", "Number of the curve.", "i4"),
    Column("law", "", "Number of the continuity law.", "i4"),
    Column("x", "of the horizontal parameter", "Points of onset curves."),
    Column("y", "of the vertical parameter", "Points of onset curves."),
    Column("frequency", "Hz", "Of the neutral mode."),
    Column("exact", "", "Neutral by the full matrices at every point, and known between them.", "?"),
    Column("mismatch", "", "Largest growth rate, by the full matrices, over the size of the eigenvalue at its points."),
)
CHECKS = (
    Column("x", "of the horizontal parameter", "Cell solved again with the full pencil."),
    Column("y", "of the vertical parameter", "Cell solved again with the full pencil."),
    Column("law", "", "Number of the continuity law.", "i4"),
    Column("growth_rate", "1/s", "Of the leading mode of the full pencil."),
    Column("frequency", "Hz", "Of the leading mode of the full pencil."),
    Column("error", "", "Relative difference of the leading eigenvalue."),
    Column("unstable", "", "Unstable eigenvalues of the full pencil.", "i4"),
    Column("agrees", "", "Error within 1e-6 and the same number of unstable eigenvalues.", "?"),
)
