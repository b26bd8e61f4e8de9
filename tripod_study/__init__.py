"""Accuracy studies: a scene run with many settings; choice of settings by accuracy, cost of a scene, summaries."""

from pathlib import Path

import tripod_sim
from tripod_sim.kernel_cache import remove_stale_kernels

remove_stale_kernels(Path(__file__).parent, Path(str(tripod_sim.__file__)).parent)
