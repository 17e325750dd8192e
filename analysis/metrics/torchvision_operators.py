"""Makes ``torchvision`` importable where its compiled extension does not load.

The metric ColorVideoVDP imports ``torchvision`` but uses none of its operators. With a CPU build of torch the
compiled extension of ``torchvision`` does not load, and the import fails at a fake implementation of the operator
``torchvision::nms``, which is then not declared. Declaring the schemas is enough for the import to succeed.
"""

from __future__ import annotations

import importlib.machinery
import importlib.util
import threading

_SCHEMA = "(Tensor dets, Tensor scores, float iou_threshold) -> Tensor"
_declared = None
_declaring = threading.Lock()


def declare_missing() -> None:
    """Declares ``nms`` and ``qnms`` unless the extension can be loaded; a second call does nothing, in any thread."""
    global _declared
    import torch

    with _declaring:
        if _declared is not None or hasattr(torch.ops.torchvision, "nms") or _extension_loads():
            return
        library = torch.library.Library("torchvision", "DEF")
        for name in ("nms", "qnms"):
            library.define(name + _SCHEMA)
        _declared = library  # the schemas live as long as this object


def _extension_loads() -> bool:
    import torch

    package = importlib.util.find_spec("torchvision")
    folders = list(package.submodule_search_locations or []) if package else []
    found = importlib.machinery.PathFinder.find_spec("_C", folders)
    if found is None or found.origin is None:
        return False
    try:
        torch.ops.load_library(found.origin)
    except OSError:
        return False
    return True
