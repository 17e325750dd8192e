"""Sizes and tolerances of paths, which the C++ does not know."""

from __future__ import annotations

ALPHA_LEAST = 1.0e-4
"""Least alpha of facets of a metallic and rough surface."""
PASSED_MOST = 64
"""Holes and clear panes that a ray passes at most."""
ROULETTE_FIRST = 3
"""Bounces after which a path may end by chance."""
ROULETTE_MOST = 0.95
"""Greatest chance that it goes on."""
SPREAD_FIRST = 2
"""Bounces whose random numbers are spread well over a group of samples."""
