"""What each simulator could not express in the cases of `peers.py`, or does otherwise; readable without it."""

NOTES: dict[str, dict[str, str]] = {
    "tripod": {
        "cantilever rest": "statics: one solution, no simulated time",
        "y L1": "statics; CPU time includes building mesh and model",
        "y L2": "statics, eight increments; CPU time includes building mesh and model",
    },
    "MuJoCo": {
        "cantilever rest": "law: St. Venant-Kirchhoff; no statics, damped motion for 0.6 s; nodal masses are set to "
        "those of the bar, since `flexcomp` shares out its mass among the free nodes alone",
        "cantilever swing": "law: St. Venant-Kirchhoff; nodal masses as at rest",
        "y L1": "law: St. Venant-Kirchhoff; no statics, damped motion for 0.6 s; interpolated (`quadratic`) cells "
        "need a box-shaped grid, which cannot be held along the clamps; the shell bends over half an element into "
        "clamp and disc, and converges slowly",
        "y L2": "as y L1; ends ride on hinges that stiff springs turn, since flexes on mocap bodies have no elasticity",
        "cloth": "springs as spatial tendons with a slack range: the same equations; its own cloth (edge "
        "equalities or a shell) is another model",
    },
    "Newton": {
        "cantilever rest": "law: stable neo-Hooke; linear tetrahedra only; no statics, "
        "damped motion for 0.6 s; single precision",
        "cantilever swing": "law: stable neo-Hooke; linear tetrahedra only; single precision; few "
        "iterations leave a step unsolved",
        "y L1": "as the bar; the disc is no rigid body but 100 times stiffer silicone; 10 or 50 iterations leave "
        "the steps unsolved, so the errors are the solver's, not the mesh's",
        "y L2": "as y L1; the nodes of the ends are moved",
        "cloth": "springs push when compressed, too: no slack ones",
    },
    "PyBullet": {
        "cantilever rest": "law: neo-Hooke; linear tetrahedra only; equal nodal masses; no statics and no mass "
        "damping: damped by its own viscosity for 0.6 s",
        "cantilever swing": "law: neo-Hooke; linear tetrahedra only; equal nodal masses",
        "y L1": "not expressed: a soft body's nodes cannot be part of a rigid disc (anchors are soft constraints)",
        "y L2": "not expressed: as y L1",
        "cloth": "springs push when compressed, too: no slack ones; their damping is set as in the scene",
    },
}
