"""A live view small enough for tests, and waiting for what it does."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from analysis.live.options import Controls, LiveOptions

SMALL = Controls(batch_size=16, resolution_px=64)
"""Both sides, at a size that takes a millisecond."""


def options(scene: str = "chase", out: Path = Path("out/live"), **controls: Any) -> LiveOptions:
    """Of a live view on one thread."""
    return LiveOptions(scene, replace(SMALL, **controls), threads=1, port=0, out=out)


def until(happened: Callable[[], Any], patience_s: float = 60.0) -> Any:
    """What a function returns as soon as that is true."""
    end_s = time.monotonic() + patience_s
    while not (found := happened()):
        assert time.monotonic() < end_s, "it never happened"
        time.sleep(0.005)
    return found
