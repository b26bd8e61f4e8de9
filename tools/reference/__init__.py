"""Pages of the reference that are written from the code each time the site is built (`make docs`)."""
