"""Figures that a run tells of itself, the same on the page and in the summary of `tripod run`: what its accuracy is and
what other accuracies cost, what its effects cost, and how stable it is. Nothing here simulates."""
