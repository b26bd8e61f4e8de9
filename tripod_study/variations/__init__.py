"""Tables of the course report's variations: one module each, with `report(full=...)`."""
