"""The runs that measure the dependence of the result on the error estimate's template and on the bias.

The slopes of the template are varied together, its offsets and the bias one at a time.

Source: Stephens 2011, sec. 7.3.2. Deviation: the thesis compares pictures of nine slope pairs of one input by eye; here
every input is also measured against the framed renderer, and offsets and bias are varied beside the slopes.
"""

from __future__ import annotations

import dataclasses
import itertools
from dataclasses import dataclass

from analysis.sensitivity.options import SensitivityOptions
from analysis.study.cases import SCALES, Case, framed_config
from analysis.study.inputs import phase_of
from tsar.config import TsarConfig


@dataclass(frozen=True)
class TemplateSetting:
    """The varied parameters: slopes and offsets of the template, and the bias."""

    spatial_slope: float
    temporal_slope: float
    spatial_offset: float
    temporal_offset: float
    bias: float

    @classmethod
    def of(cls, tsar: TsarConfig) -> TemplateSetting:
        """The setting of a configuration."""
        e = tsar.error
        return cls(e.spatial_slope, e.temporal_slope, e.spatial_offset, e.temporal_offset, tsar.response.bias)

    def changed(self, **values: float) -> TemplateSetting:
        """The setting with some values replaced."""
        # adding zero turns -0.0 into 0.0: equal settings must not have two names
        return dataclasses.replace(self, **{name: float(value) + 0.0 for name, value in values.items()})

    def applied(self, tsar: TsarConfig) -> TsarConfig:
        """The configuration at this setting."""
        values = dataclasses.asdict(self)
        response = dataclasses.replace(tsar.response, bias=values.pop("bias"))
        return dataclasses.replace(tsar, error=dataclasses.replace(tsar.error, **values), response=response)


AXES = {
    "slopes": ("spatial_slope", "temporal_slope"),
    "spatial offset": ("spatial_offset",),
    "temporal offset": ("temporal_offset",),
    "bias": ("bias",),
}
"""Sweeps, and the parameters that each varies."""


def sweeps(options: SensitivityOptions) -> dict[str, list[TemplateSetting]]:
    """Settings of every sweep; those of the slopes in rows of equal temporal slope, each with the steepest spatial one
    first."""
    base = TemplateSetting.of(options.tsar)
    slopes = itertools.product(sorted(options.temporal_slopes), sorted(options.spatial_slopes))
    offsets = sorted(options.offsets)
    return {
        "slopes": [base.changed(spatial_slope=spatial, temporal_slope=temporal) for temporal, spatial in slopes],
        "spatial offset": [base.changed(spatial_offset=base.spatial_offset + change) for change in offsets],
        "temporal offset": [base.changed(temporal_offset=base.temporal_offset + change) for change in offsets],
        "bias": [base.changed(bias=bias) for bias in sorted(options.biases)],
    }


@dataclass(frozen=True)
class Run:
    """A case and its place in the study; the framed renderer has no setting."""

    input: str
    setting: TemplateSetting | None
    repetition: int
    case: Case

    @property
    def place(self) -> tuple[str, TemplateSetting | None, int]:
        """Input, setting and repetition."""
        return self.input, self.setting, self.repetition


def runs(options: SensitivityOptions) -> list[Run]:
    """Every run once: the framed renderer, the default setting, and all others.

    Raises:
        ConfigError: a setting is out of range.
    """
    scale = SCALES[options.scale]
    row = scale.config(options.row, options.tsar)
    settings = dict.fromkeys([TemplateSetting.of(options.tsar), *itertools.chain(*sweeps(options).values())])
    framed, found = framed_config(row.resolution_px), []
    for repetition, name in itertools.product(range(options.repetitions), options.inputs):
        seeded = dataclasses.replace(row, seed=repetition)
        for setting in (None, *settings):
            case = Case(
                input=name,
                policy="thesis" if setting else "framed",
                tsar=setting.applied(seeded) if setting else framed,
                scale=scale,
                phase=phase_of(name, repetition, options.repetitions),
                ledger=options.ledger,
                stills_s=(options.still_s,) if repetition == 0 else (),
            )
            found.append(Run(name, setting, repetition, case))
    return found
