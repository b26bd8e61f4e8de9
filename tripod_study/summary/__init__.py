"""Summaries of a run for `tripod run` and the page: accuracy and its price, effects, energy, stability, picture."""
