"""Results printed in the dissertation, for comparison with ours. Source: Stephens 2011, table 7.2 and sec. 7.2.5."""

from __future__ import annotations

SUITABLE_PERCENTILE = (
    (16, 100, 100, 20, 11), (11, 99, 100, 10, 16), (6, 86, 100, 8, 6), (53, 100, 100, 53, 90),
    (38, 100, 100, 21, 87), (32, 95, 100, 15, 84), (70, 100, 100, 55, 91), (57, 100, 100, 31, 91),
    (45, 99, 100, 20, 88), (56, 100, 100, 28, 91), (44, 99, 100, 20, 88), (80, 100, 100, 52, 91),
    (45, 100, 100, 19, 88), (55, 100, 100, 28, 91), (45, 100, 100, 19, 88), (45, 100, 100, 19, 88),
)  # fmt: skip
"""Greatest suitable percentile of each row of table 7.2 for inputs 0 to 4."""

SHARES = {
    "ratios at most 1": 0.66,
    "runs suitable always": 1.0 / 3.0,
    "runs suitable 90 % of the time": 0.46,
    "runs suitable half of the time": 0.67,
}
"""Shares of all ratio values, and of the 80 runs."""
