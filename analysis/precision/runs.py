"""The runs of the study of precision: everything that a policy keeps, in every format, alone and together."""

from __future__ import annotations

import dataclasses
import itertools
from dataclasses import dataclass

from analysis.precision.options import PrecisionOptions
from analysis.study.cases import SCALES, Case
from analysis.study.inputs import phase_of
from tsar.named import require_known
from tsar.policies.stored import ALL

TEXTURES = "textures"
OWN = "as it is"
"""Stands for the policy's own formats."""
COLORS = ("bfloat16", "float16", "unorm8")
NUMBERS = ("bfloat16", "float16", "float8")
DOUBLES = ("float32", "bfloat16", "float16")
KEPT: dict[str, dict[str, tuple[str, ...]]] = {
    "tsar": {
        ALL: ("float64", "bfloat16", "float16"),
        "samples": COLORS,
        "colors": COLORS,
        "variances": NUMBERS,
        "change": NUMBERS,
        "points": NUMBERS,
        "places": NUMBERS,
        "times": DOUBLES,
        "picture": COLORS,
        TEXTURES: COLORS,
    },
    "thesis": {
        ALL: ("float64", "bfloat16", "float16"),
        "samples": COLORS,
        "colors": COLORS,
        "wavelets": NUMBERS,
        "errors": NUMBERS,
        "densities": DOUBLES,
        "times": DOUBLES,
        "picture": COLORS,
        TEXTURES: COLORS,
    },
}
"""The values that each policy keeps (:data:`tsar.policies.stored.FIELDS`), and the formats to try for them. By default
times and densities are float64, and everything else is float32."""


@dataclass(frozen=True)
class Run:
    """A case and its place in the study.

    Attributes:
        policy, kept, form: the policy, the kind of its values, and their format; :data:`OWN` for the unchanged policy.
        repetition: 0, 1, …
    """

    policy: str
    kept: str
    form: str
    repetition: int
    case: Case


def runs(options: PrecisionOptions) -> list[Run]:
    """Every run.

    Raises:
        ConfigError: no policy keeps a kind of value that was asked for.
    """
    known = dict.fromkeys(name for policy in options.policies for name in KEPT[policy])
    for name in options.kept:
        require_known(name, "kept", known)
    scale = SCALES[options.scale].errors_alone
    found = []
    for repetition, policy, name in itertools.product(range(options.repetitions), options.policies, options.inputs):
        whole = Case(
            input=name,
            policy=policy,
            tsar=scale.config(options.row, dataclasses.replace(options.tsar, seed=repetition)),
            scale=scale,
            phase=phase_of(name, repetition, options.repetitions),
            start_s=options.start_s,
            formats=(("samples", "float32"),),  # changes nothing, but records the requested batches
        )
        found.append(Run(policy, OWN, OWN, repetition, whole))
        for kept, forms in KEPT[policy].items():
            if options.kept and kept not in options.kept:
                continue
            for form in forms:
                if kept == TEXTURES:
                    case = dataclasses.replace(whole, tracing=(("texels", form),))
                else:
                    case = dataclasses.replace(whole, formats=((kept, form),))
                found.append(Run(policy, kept, form, repetition, case))
    return found
