"""Sizes and tolerances of path tracing, which the C++ does not use."""

from __future__ import annotations

ALPHA_LEAST = 1.0e-4
"""Least alpha of the facets of a metallic-roughness surface."""
PASSED_MOST = 64
"""Maximum number of holes and clear panes that a ray passes."""
ROULETTE_FIRST = 3
"""Number of bounces after which a path may end at random."""
ROULETTE_MOST = 0.95
"""Greatest probability that it continues."""
SPREAD_FIRST = 2
"""Number of bounces whose random numbers are stratified over a group of samples."""
