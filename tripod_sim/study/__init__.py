"""Studies: a scene run under many settings, one row of a table for each."""
