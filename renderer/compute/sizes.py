"""Sizes with which all native code is compiled."""

from __future__ import annotations

import math
from enum import IntEnum

LANES = 16
"""Width of SIMD vectors, floats: the samples or rays of a packet."""

MAIL_WORDS = 16
"""Length of a mailbox in int64 words: two cache lines, so that no two mailboxes share one."""


class Mail(IntEnum):
    """Indices in the mailbox between a caller and a helper.

    A launch, as Warp makes it, is a compiled kernel (``FUNCTION``) and its two parameters. ``ANSWER`` holds the answer
    of ``post`` and ``join``; ``REST`` is set from outside to make the helper park without waiting.
    """

    STATE, FUNCTION, BOUNDS, ARGUMENTS, ANSWER, REST = range(6)


class State(IntEnum):
    """State of a helper."""

    IDLE, POSTED, RUNNING, PARKED = range(4)


GIVEN: dict[str, float] = {
    "LANES": LANES,
    "PI": math.pi,
    **{f"MAIL_{place.name}": int(place) for place in Mail},
    **{state.name: int(state) for state in State},
}
"""The constants of this module as the C++ gets them."""
