"""Eight-node hexahedron with mean dilatation (H8 mean): one volume change for all points of an element.

Where the material is nearly incompressible the plain H8 locks: eight points each forbid a change of volume, more than
its nodes can follow. Here the points share the mean v* = (1/V) int v dV of the law's measure of volume v,

    E = int psi_0(F) + kappa/2 (v* - c)^2 dV = int psi(F) dV - kappa/2 int (v - v*)^2 dV,

which is what the three-field principle leaves once its constant dilatation and constant pressure are eliminated
[Nagtegaal1974], [SimoTaylorPister1985]; v, psi_0, kappa and c of each law: `tripod_sim.materials.laws`. As force
and tangent derive from E they agree with it, and the tangent is symmetric. Uniform strains are those of the plain
element (patch test). Against locking in bending it does nothing: that takes several elements through the thickness, or
incompatible modes.
"""

from dataclasses import replace

from tripod_sim.elements.hexahedron import H8

H8_MEAN = replace(H8, name="h8_mean", linear=H8, mean_dilatation=True)
