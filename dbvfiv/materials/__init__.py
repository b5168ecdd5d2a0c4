"""Material laws of a layered wall: rubbers, isotropic sheets and fibre plies, their stability, and how they relax.

Each law is a strain energy in five Green-Lagrange strains with S33 = 0 (see `energy`);
stresses and tangents follow by differentiation, in float64.
"""
