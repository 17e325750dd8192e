"""Who watches a live view and who drives it: what pages are told, and what they ask for. Knows no network."""

from __future__ import annotations

import json
import math
import threading
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from analysis.live.engine import SIDES, Engine
from analysis.live.freeze import KEYS, VIEWS, Frozen
from analysis.live.overlays import PLAIN, Key, codes, laid_over, mean_newest_s, overlays, predicted_error
from analysis.live.requests import REQUESTS, standing
from analysis.live.runner import DisplayState, Runner
from analysis.page.pictures import PagePixels
from analysis.page.video import AGES
from tsar.checks import require


@dataclass
class Watcher:
    """A page that is open. Changes in place.

    Attributes:
        number: of those that came.
        sent: what was sent of each side last.
        note: what its page is told once.
    """

    number: int
    sent: dict[str, Any] = field(default_factory=dict)
    note: str = ""


@dataclass
class DisplayChoices:
    """How the sides are shown, by side. Changes in place."""

    overlay: dict[str, str] = field(default_factory=lambda: dict.fromkeys(SIDES, PLAIN))
    strength: float = 0.6


class Hub:
    """The one live view of all pages. Changes in place; calls from several threads take turns.

    Attributes:
        engine: what is seen.
        frozen: the moment that is held; None while the view goes on.
        display: how the sides are shown.
    """

    def __init__(self, engine: Engine) -> None:
        self.engine = engine
        self.frozen: Frozen | None = None
        self._watchers: dict[int, Watcher] = {}
        self._driver, self._came = 0, 0
        self.display, self._lock = DisplayChoices(), threading.RLock()
        self._drawn: dict[str, tuple[Any, tuple[PagePixels, Key]]] = {}
        self._told: dict[str, tuple[Any, tuple[float | None, float | None]]] = {}

    def came(self) -> Watcher:
        """A page was opened; it drives if no other does. While any is open the engine goes on."""
        with self._lock:
            self._came += 1
            self._watchers[self._came] = watcher = Watcher(self._came)
            self._driver = self._driver or watcher.number
            if self.frozen is None:
                self.engine.wake()
            return watcher

    def left(self, watcher: Watcher) -> None:
        """A page was closed, or its connection was lost; if it drove, the one that came first drives now."""
        with self._lock:
            self._watchers.pop(watcher.number, None)
            if self._driver == watcher.number:
                self.engine.timeline.change(standing)
                self._driver = min(self._watchers, default=0)
            if not self._watchers:
                self.engine.rest()

    def heard(self, watcher: Watcher, text: str) -> None:
        """Does what a page asks for, if it drives; what is wrong with that its page is told."""
        try:
            message = json.loads(text)
            require(isinstance(message, dict), "message", "an object", type(message).__name__)
            asked = message.pop("do", None)
            with self._lock:
                if asked == "drive":
                    self.engine.timeline.change(standing)
                    self._driver = watcher.number
                elif self._driver == watcher.number:
                    known = isinstance(asked, str) and asked in REQUESTS
                    require(known, "do", "something that a page can ask for", asked)
                    watcher.note = REQUESTS[asked](self, message) or ""
        except KeyError as error:
            watcher.note = f"expected a field {error}"
        except Exception as error:  # a page may ask for anything, and what a policy or a metric does may be anybody's
            watcher.note = one_line(error)

    def frame(self, watcher: Watcher) -> bytes:
        """What a page is sent: the length of a header, four bytes, the header, and what pictures are new."""
        with self._lock:
            look, frozen, driver = self.engine.look(), self.frozen, self._driver
            display = replace(self.display, overlay=dict(self.display.overlay))
            note, watcher.note = watcher.note, ""
        sides = {side: self._facts(side, look.runs[side], look.sides[side], look.time_s) for side in SIDES}
        pictures: list[bytes] = []
        for side in SIDES:
            run, seen, facts = look.runs[side], look.sides[side], sides[side]
            if seen is not None and run is not None:
                config = self.engine.controls.config()
                known = overlays(seen, config, look.time_s)
                views = [view for view in VIEWS if frozen is not None and side in frozen.errors]
                facts["overlays"] = [PLAIN, *known, *views]
                overlay = display.overlay[side]
                moment = round(look.time_s, 1) if overlay == AGES and overlay in known else 0.0
                key = run, seen.number, overlay, display.strength, frozen, moment
                if watcher.sent.get(side) != key:
                    watcher.sent[side] = key
                    pixels, meaning = self._pixels(side, key, seen, known, frozen)
                    facts |= {"scale": meaning.scale, "colours": meaning.colours}
                    facts |= {"height": pixels.shape[0], "width": pixels.shape[1], "bytes": pixels.nbytes}
                    pictures.append(pixels.tobytes())
        header = json.dumps(
            {
                "drives": watcher.number == driver,
                "watchers": len(self._watchers),
                "note": note,
                "sides": sides,
                **self._state(look.time_s, display, frozen),
            },
            allow_nan=False,
        ).encode()
        return b"".join((len(header).to_bytes(4, "little"), header, *pictures))

    def _pixels(
        self, side: str, key: Any, seen: DisplayState, known: Mapping[str, Any], frozen: Frozen | None
    ) -> tuple[PagePixels, Key]:
        """Pixels of a side, and what their colours mean; those that another page was sent are not made again."""
        overlay, strength = key[2], key[3]
        before = self._drawn.get(side)
        if before is not None and before[0] == key:
            return before[1]
        if frozen is not None and overlay in VIEWS and side in frozen.errors:
            found = frozen.drawn(side, overlay), KEYS.get(overlay, Key())
        elif overlay in known:
            picture = codes(seen.shown[1].image)
            try:
                one = known[overlay]()
                found = laid_over(picture, one, strength), Key.of(one.scale)
            except Exception as error:  # a map may be anybody's: the picture is shown without it
                found = picture, Key(f"cannot be drawn ({one_line(error)})")
        else:
            found = codes(seen.shown[1].image), Key()
        self._drawn[side] = key, found
        return found

    def _facts(self, side: str, run: Runner | None, seen: DisplayState | None, time_s: float) -> dict[str, Any]:
        """What a page is told of a side in numbers; what costs time is taken once of a picture."""
        if run is None:
            return {"name": ""}
        found: dict[str, Any] = {"name": run.name, "cycles": run.cycles, "worked_s": run.worked_s, "error": run.error}
        if seen is not None and seen.shown[1].spent is not None:
            key, values = self._told.get(side, (None, (None, None)))
            if key != (run, seen.number):
                values = mean_newest_s(seen), predicted_error(seen)
                self._told[side] = (run, seen.number), values
            newest_s, predicted = values
            found |= {
                "number": seen.number,
                "cycle_ms": 1e3 * seen.shown[1].spent.cost_s,
                "age_ms": None if newest_s is None else 1e3 * (time_s - newest_s),
                "predicted": predicted,
            }
        return _finite(found)

    def _state(self, time_s: float, display: DisplayChoices, frozen: Frozen | None) -> dict[str, Any]:
        engine = self.engine
        animation, timeline = engine.timeline.animation, engine.timeline
        held_at = None
        if frozen is not None:
            errors = {side: _finite(of_side) for side, of_side in frozen.errors.items()}
            held_at = {"errors": errors, "names": frozen.names, "missing": frozen.missing}
        return {
            "time_s": time_s,
            "animation": asdict(animation),
            "rides": timeline.drive.rides,
            "recording": engine.recorded_s if engine.recording else None,
            "controls": asdict(engine.controls),
            "overlay": display.overlay,
            "strength": display.strength,
            "frozen": held_at,
        }


def _finite(facts: Mapping[str, Any]) -> dict[str, Any]:
    """With None for numbers that JSON cannot hold."""
    return {name: None if isinstance(one, float) and not math.isfinite(one) else one for name, one in facts.items()}


def one_line(error: Exception) -> str:
    """What an error says, in at most 300 letters."""
    return " ".join(f"{error}".split())[:300] or type(error).__name__
