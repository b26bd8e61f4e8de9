"""From the surface or the CAD file of a part to a mesh of tetrahedra."""
