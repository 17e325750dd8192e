"""The table of policies: the project's own, those of installed packages, and those added from Python."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from tsar.named import Named

if TYPE_CHECKING:
    from tsar.policy import Policy, Setting

    Make = Callable[[Setting], Policy[Any]]

POLICIES: Named[Make] = Named(
    "policy",
    "tsar.policies",
    {
        "tsar": "tsar.policies.filter:Filter",
        "filter": "tsar.policies.filter:unmoved",
        "tsar-densities": "tsar.policies.densities:ByDensities",
        "tsar-wavelets": "tsar.policies.densities:by_wavelets",
        "tsar-densities-wavelets": "tsar.policies.densities:dense_by_wavelets",
        "surfel": "tsar.policies.surfel:Surfel",
        "thesis": "tsar.policies.thesis:Thesis",
        "framed": "tsar.policies.framed:Framed",
        "framed-1": "tsar.policies.framed:PromptlyFramed",
        "framed-super": "tsar.policies.framed:supersampled",
        "framed-half": "tsar.policies.framed:halved",
        "framed-quarter": "tsar.policies.framed:quartered",
        "framed-taa": "tsar.policies.reprojected:accumulating",
        "framed-late": "tsar.policies.reprojected:late",
        "framed-taa-late": "tsar.policies.reprojected:accumulating_late",
        "frameless": "tsar.policies.frameless:Frameless",
        "afr": "tsar.policies.afr:Afr",
        "afr-simple": "tsar.policies.afr_simple:AfrSimple",
        "interruptible": "tsar.policies.interruptible:Interruptible",
        "oracle": "tsar.policies.oracle:Oracle",
    },
)

RIVALS = (
    *("framed-1", "framed-super", "framed-half", "framed-quarter", "framed-taa", "framed-late", "framed-taa-late"),
    *("frameless", "afr", "afr-simple", "interruptible"),
)
"""Rivals other than ``framed`` that do not use the reference image: a policy is compared with each of them, and with
the best at each time."""
