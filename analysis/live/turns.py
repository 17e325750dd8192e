"""One machine, shared: of those that work, who has spent least goes on.

Each works in a thread of its own, one at a time, and offers to let others go on when it can: after every part of a
batch. So all advance by the same measured time, however long the cycles of one are.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable


class Over(Exception):
    """Raised in the thread of one whose work is to end."""


class Turns:
    """Who works now. Changes in place."""

    def __init__(self, now: Callable[[], float] = time.perf_counter) -> None:
        """Takes a clock, seconds."""
        self._now, self._changed = now, threading.Condition()
        self._spent: dict[int, float] = {}
        self._worked: dict[int, float] = {}
        self._ended: set[int] = set()
        self._holder: int | None = None
        self._since = 0.0
        self._next, self._halts = 0, 0

    def join(self) -> int:
        """A new one; it has spent as much as who has spent least. Its number."""
        with self._changed:
            self._next += 1
            self._spent[self._next] = min(self._spent.values(), default=0.0)
            self._worked[self._next] = 0.0
            return self._next

    def take(self, who: int) -> None:
        """Waits until it is one's turn.

        Raises:
            Over: one's work is to end.
        """
        with self._changed:
            self._changed.wait_for(lambda: who in self._ended or self._may(who))
            if who in self._ended:
                raise Over
            self._holder, self._since = who, self._now()

    def offer(self, who: int) -> None:
        """Lets others go on who have spent less, and waits until it is one's turn again.

        Raises:
            Over: one's work is to end.
        """
        with self._changed:
            self._pause(who)
            if who not in self._ended and self._may(who):
                self._holder, self._since = who, self._now()
                return
            self._changed.notify_all()
        self.take(who)

    def leave(self, who: int) -> None:
        """One is done; also where it does not work now."""
        with self._changed:
            if self._holder == who:
                self._holder = None
            self._spent.pop(who, None)
            self._ended.discard(who)
            self._changed.notify_all()

    def end(self, who: int) -> None:
        """Has one end when it next offers or waits."""
        with self._changed:
            if who in self._spent:
                self._ended.add(who)
            self._changed.notify_all()

    def forgive(self, who: int) -> None:
        """What one has spent so far, such as on compiling, is not held against it."""
        with self._changed:
            self._pause(who)
            others = [spent for one, spent in self._spent.items() if one != who]
            self._spent[who] = min(others, default=0.0)
            self._holder, self._since = who, self._now()

    def halt(self) -> None:
        """Waits until nobody works; nobody does until :meth:`go_on` was called as often."""
        with self._changed:
            self._halts += 1
            self._changed.wait_for(lambda: self._holder is None)

    def go_on(self) -> None:
        """Ends a halt."""
        with self._changed:
            self._halts -= 1
            self._changed.notify_all()

    def worked(self, who: int) -> float:
        """Seconds that one has worked so far."""
        with self._changed:
            return self._worked[who] + (self._now() - self._since if self._holder == who else 0.0)

    def _pause(self, who: int) -> None:
        gone_s = self._now() - self._since
        self._spent[who] += gone_s
        self._worked[who] += gone_s
        self._holder = None

    def _may(self, who: int) -> bool:
        if self._holder is not None or self._halts:
            return False
        waiting = {one: spent for one, spent in self._spent.items() if one not in self._ended}
        return who == min(waiting, key=lambda one: (waiting[one], one))
