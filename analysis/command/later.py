"""Commands that are imported when they are called. No module that decides a result may import this one."""

from __future__ import annotations

import importlib
from collections.abc import Callable


def command(module: str) -> Callable[[], None]:
    """The function ``main`` of a module that is imported at the call: Ctrl-C during the import ends in one line."""

    def main() -> None:
        importlib.import_module(module).main()

    return main
