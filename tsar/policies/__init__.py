"""Policies by name: the project's own, those of installed packages, and those that are added from Python."""

from collections.abc import Callable

from tsar.named import Named
from tsar.policy import Policy, Setting

Make = Callable[[Setting], Policy]

POLICIES: Named[Make] = Named(
    "policy",
    "tsar.policies",
    {
        "tsar": "tsar.policies.adaptive:Adaptive",
        "framed": "tsar.policies.framed:Framed",
        "framed supersampled": "tsar.policies.framed:supersampled",
        "frameless": "tsar.policies.frameless:Frameless",
        "afr": "tsar.policies.afr:Afr",
        "oracle": "tsar.policies.oracle:Oracle",
    },
)
