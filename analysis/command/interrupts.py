"""Reliable Ctrl-C: libraries drop a KeyboardInterrupt that reaches them in a callback or while they load."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_AGAIN_S = 0.5

_TIMED = hasattr(signal, "setitimer")  # not on Windows
SIGNALS = (signal.SIGINT, signal.SIGALRM) if _TIMED else (signal.SIGINT,)
"""Signals that interrupt: Ctrl-C, and the timer that repeats it."""


@contextmanager
def heeded() -> Iterator[None]:
    """Makes Ctrl-C raise KeyboardInterrupt in the block, and raise it again every half second until it is handled.

    Cleaning up is not disturbed. An error that follows a lost KeyboardInterrupt, such as that of a module that could
    not be loaded, counts as the KeyboardInterrupt. Outside the main thread, or if Ctrl-C has another handler
    already, or where the system has no timer, nothing changes.
    """
    ours = threading.current_thread() is threading.main_thread()
    if not ours or not _TIMED or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    before = {number: signal.signal(number, _interrupt) for number in SIGNALS}
    try:
        yield
    except Exception as error:
        if signal.getitimer(signal.ITIMER_REAL)[0]:
            raise KeyboardInterrupt from error
        raise
    finally:
        settled()
        for number, handler in before.items():
            signal.signal(number, handler)


def settled() -> None:
    """Marks a Ctrl-C as handled: it is not raised again."""
    if _TIMED:
        signal.setitimer(signal.ITIMER_REAL, 0.0)


def _interrupt(number: int, frame: FrameType | None) -> None:
    signal.setitimer(signal.ITIMER_REAL, _AGAIN_S)
    error = sys.exc_info()[1]
    while error is not None:
        if isinstance(error, KeyboardInterrupt):
            return
        error = error.__context__
    raise KeyboardInterrupt
