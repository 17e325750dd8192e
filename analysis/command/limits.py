"""Bounds that options of several commands share, and checks of a run's size before it begins."""

from __future__ import annotations

import math

from tsar.config import require

SEEDS = (0, 2**32 - 1)
THREADS = (0, 1024)
WORKERS = (0, 256)
WORKER_WAITS_S = (1.0, 1e6)
SIDES_PX = (1, 32768)
TIMES_S = (-1e9, 1e9)
"""Animation times, seconds; float64 resolves 1.2e-7 s there."""
SPANS_S = (1e-6, 1e6)
RATES_HZ = (1e-3, 1e6)
SEGMENTS = (1e-3, 1e6)
"""Ray segments per sample."""
REPETITIONS = (1, 1000)

CYCLES_MOST = 1_000_000
"""Cycles, framed images or reference images of one run."""
_STEPS_PER_CYCLE = 1000
"""Number of float64 steps of time that a cycle must have at least."""


def within(options: object, **bounds: tuple[float, float]) -> None:
    """Checks that each of the named fields, one number or several, lies within its bounds, both inclusive.

    Args:
        options: a record.
        bounds: least and greatest value of each field, finite, so that NaN and infinity are refused. A field that is
            None is not checked.

    Raises:
        ConfigError: a field is out of its bounds.
    """
    for name, (low, high) in bounds.items():
        value = getattr(options, name)
        for one in value if isinstance(value, tuple) else (value,):
            require(one is None or low <= one <= high, name, f"between {_in_words(low)} and {_in_words(high)}", one)


def _in_words(value: float) -> str:
    return str(value) if isinstance(value, int) else f"{value:g}"


def require_count(name: str, value: object, count: float, what: str, most: int = CYCLES_MOST) -> None:
    """Refuses a run of more than ``most`` steps.

    Args:
        name, value: the option to blame, and its value.
        count: number of steps that the options ask for.
        what: name of these steps in the message.
        most: greatest number allowed.

    Raises:
        ConfigError: there are too many steps.
    """
    require(count <= most, name, f"at most {most:,} {what}; these options ask for {count:,.6g}", value)


def require_pace(name: str, value: object, cycle_s: float, start_s: float, seconds: float, warmup_cycles: int) -> None:
    """Refuses a simulated machine on which cycles are too long, too many, or too short for their times to differ.

    Args:
        name, value: the option that sets the speed of the machine, and its value.
        cycle_s: duration of a cycle on the machine, seconds.
        start_s, seconds: start and length of the measurement, seconds of animation time.
        warmup_cycles: cycles before the measurement.

    Raises:
        ConfigError: the machine is too slow or too fast.
    """
    fits = f"cycles no longer than the {seconds:g} s that are measured; they take {cycle_s:.3g} s at this capacity"
    require(cycle_s <= seconds, name, fits, value)
    require_count(name, value, seconds / cycle_s + warmup_cycles, "cycles")
    latest_s = abs(start_s) + seconds + warmup_cycles * cycle_s
    least_s = _STEPS_PER_CYCLE * math.ulp(latest_s)
    fits = f"cycles of at least {least_s:.3g} s, for times near {latest_s:g} s to differ; they take {cycle_s:.3g} s"
    require(cycle_s >= least_s, name, fits, value)
