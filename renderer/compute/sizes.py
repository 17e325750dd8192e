"""Sizes that the native code of every room is compiled with."""

from __future__ import annotations

import math
from enum import IntEnum

LANES = 16
"""Floats that go through the same arithmetic side by side: the samples or rays of a packet."""

MAIL_WORDS = 16
"""Length of a mailbox, int64: two cache lines, so that no two mailboxes share one."""


class Mail(IntEnum):
    """Places in the mailbox between a caller and a helper.

    A launch, as Warp makes it, is a compiled kernel (``FUNCTION``) and its two parameters. ``ANSWER`` is that of
    ``post`` and ``join``; ``REST`` is set from outside and says to park without waiting.
    """

    STATE, FUNCTION, BOUNDS, ARGUMENTS, ANSWER, REST = range(6)


class State(IntEnum):
    """What a helper does."""

    IDLE, POSTED, RUNNING, PARKED = range(4)


GIVEN: dict[str, float] = {
    "LANES": LANES,
    "PI": math.pi,
    **{f"MAIL_{place.name}": int(place) for place in Mail},
    **{state.name: int(state) for state in State},
}
"""As in :mod:`renderer.layout.sizes`."""
