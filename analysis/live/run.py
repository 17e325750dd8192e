"""Shows a live view until it is interrupted."""

from __future__ import annotations

import threading

from analysis.command.cli import bad_input
from analysis.command.ownership import writable_folder
from analysis.live.engine import Engine
from analysis.live.hub import Hub
from analysis.live.options import LiveOptions
from analysis.live.server import watching


def watched(options: LiveOptions, over: threading.Event | None = None) -> None:
    """Serves the page, says where it is, and returns when ``over`` is set: never, by default.

    Raises:
        InputError: the scene or the port cannot be had, or sessions cannot be written.
        KeyboardInterrupt: Ctrl-C ends it.
    """
    over = over or threading.Event()
    with bad_input():
        writable_folder(options.out, "out")
        engine = Engine(options)
    for loss in engine.losses:
        print(loss)
    try:
        with watching(Hub(engine), options.input, options.port, options.host) as address:
            print(f"live view of {options.input}: {address} (Ctrl-C ends it)", flush=True)
            while not over.wait(0.5):
                pass
    finally:
        engine.close()
