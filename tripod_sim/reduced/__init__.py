"""The reduced-order model of the Tripod: few coordinates instead of all nodes, few elements instead of all."""
