"""The knobs that trade cost for error: their values, and cases from settings of several knobs."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from math import frexp
from typing import Any

from analysis.study.cases import ROWS, Case, Scale
from tsar.config import TsarConfig, require
from tsar.filtering.options import DEFAULT
from tsar.named import require_known
from tsar.policies import RIVALS

OWN, THESIS = "tsar", "thesis"
ROW = 7
"""Row of table 7.2: batch 128 at 512². Knobs that are not turned have the values of this row."""
BATCHES_HZ = 50.0
"""Batches a second: the number that ``tsar`` samples at row 7 on the machine that shows 8 framed images a second."""

Value = bool | int | float | str


@dataclass(frozen=True)
class Knob:
    """A knob, which is a parameter of a run.

    Attributes:
        name: name as one word, for the command line.
        words: description.
        policy: policy to which it belongs.
        default: default value.
        values: further values to try.
        part: name of the option of the policy ``tsar``; empty if it is none.
        field: dotted name of the field of :class:`tsar.config.TsarConfig`; empty if it is none.
        tracing: name in :data:`analysis.study.cases.TRACING`; empty if it is none.
    """

    name: str
    words: str
    policy: str
    default: Value
    values: tuple[Value, ...]
    part: str = ""
    field: str = ""
    tracing: str = ""


_SWITCHES = {
    "accumulation": "samples averaged over time",
    "smoothing": "uncertain pixels blended when they are shown",
    "reprojection": "estimates that move with their surfaces",
    "prediction": "poses predicted for the middle of the display",
    "jitter": "samples that move within their pixels",
    "by_gain": "tiles chosen by their gain",
    "shadows": "change expected where shadows move",
    "spread": "change expected beside what changed",
    "probes": "tiles that look where nothing is expected",
    "noise": "noise of random samples told from detail",
}
_NUMBERS: dict[str, tuple[str, tuple[Value, ...]]] = {
    "share_max": (
        "longest cycle, as a share of the pixels of a picture of 256² or more",
        (1 / 128, 1 / 64, 1 / 16, 1 / 8),
    ),
    "footprint": ("samples along a pixel's side that textures are filtered for", (1, 2, 8)),
    "latency_cycles": ("cycles from sampling to display", (2, 3)),
    "memory_s": ("time that observed change is remembered, seconds", (0.05, 0.8)),
    "life_max_s": ("longest time that a sample counts, seconds", (0.5, 16.0)),
    "reach": ("image sides beyond which a moving surface is out of sight", (1 / 32, 1 / 2)),
}


def _part(name: str, words: str, values: tuple[Value, ...]) -> Knob:
    return Knob(name.replace("_", "-"), words, OWN, getattr(DEFAULT, name), values, part=name)


KNOBS: dict[str, Knob] = {
    knob.name: knob
    for knob in (
        Knob("policy", "policy that decides what is sampled", OWN, OWN,
             ("filter", "tsar-densities", THESIS, "framed", *RIVALS)),
        Knob("batch", "framelets rendered 50 times a second", OWN, 128, (16, 32, 64, 256, 512),
             field="batch_size"),
        Knob("resolution", "share of the display's side that is rendered", OWN, 1.0, (0.5, 0.25)),
        *(_part(name, words, values) for name, (words, values) in _NUMBERS.items()),
        *(_part(name, words, (False,)) for name, words in _SWITCHES.items()),
        Knob("wavelets", "roughness and change measured by wavelets", OWN, False, (True,), part="wavelets"),
        Knob("depth", "mirror reflections that are followed", OWN, "of the scene", (0, 1), tracing="depth"),
        Knob("light-cells", "shadow rays along each axis of a light with an extent; 0 for one in all", OWN,
             "of the scene", (2, 4), tracing="light_cells"),
        Knob("structure", "tree over the triangles", OWN, "bvh", ("kdtree",), tracing="structure"),
        Knob("packets", "sixteen samples traced together", OWN, True, (False,), tracing="packets"),
        Knob("framelet", "samples along a framelet's side", THESIS, 16, (32,), field="framelet_side"),
        Knob("field", "elements along the side of the density and error fields", THESIS, 128, (64, 256),
             field="sdf_side"),
        Knob("octaves", "comparison of the octaves of the error with their template", THESIS, "sum", ("greatest",),
             field="error.octaves"),
        Knob("extent", "part of a tile whose power is summed", THESIS, "element", ("tile",), field="error.extent"),
        Knob("estimator", "measure of power", THESIS, "dwt", ("variance", "fft"), field="error.estimator"),
        Knob("cache", "framelets kept", THESIS, 2048, (4096, 8192), field="cache_size"),
        Knob("tiles", "most tiles of a tiling", THESIS, 512, (256, 1024), field="tiling.tile_count_max"),
        Knob("age-support", "pixels over which ages are smoothed", THESIS, 9, (1, 33, 129),
             field="reconstruction.age_support_px"),
    )
}  # fmt: skip
"""Every knob by its name. Numbers in framelets, elements and pixels are of the thesis' own size."""

Changes = tuple[tuple[str, Value], ...]


@dataclass(frozen=True)
class KnobSetting:
    """A policy, and the values of its knobs.

    Attributes:
        policy: policy that decides what is sampled.
        changes: values of the knobs that differ from their default, by name in the order of :data:`KNOBS`.
    """

    policy: str = OWN
    changes: Changes = ()

    @property
    def words(self) -> str:
        """The setting in words."""
        return ", ".join([self.policy, *(f"{name} {said(value)}" for name, value in self.changes)])


def said(value: Value) -> str:
    """A value of a knob, as text."""
    if isinstance(value, bool):
        return "on" if value else "off"
    if isinstance(value, float) and 0.0 < value < 0.2 and frexp(value)[0] == 0.5:
        return f"1/{1.0 / value:g}"
    return f"{value:g}" if isinstance(value, float) else str(value)


def turned(policy: str = OWN, **values: Value) -> KnobSetting:
    """A setting of a policy from the values of some knobs, by name with underscores for hyphens."""
    named = {name.replace("_", "-"): value for name, value in values.items()}
    return setting_of(policy, named)


def setting_of(policy: str, values: Mapping[str, Value]) -> KnobSetting:
    """As :func:`turned`, from unchanged names."""
    changes = [(name, values[name]) for name in KNOBS if name in values and values[name] != KNOBS[name].default]
    return KnobSetting(policy, tuple(changes))


def alone(knob: Knob) -> list[tuple[Value, KnobSetting]]:
    """Every value of a knob, with all others at their defaults."""
    if knob.name == "policy":
        return [(value, KnobSetting(str(value))) for value in (knob.default, *knob.values)]
    return [(value, setting_of(knob.policy, {knob.name: value})) for value in (knob.default, *knob.values)]


def chosen_knobs(names: Sequence[str], option: str = "knobs") -> tuple[Knob, ...]:
    """Knobs by their names, which the option has; all knobs where no name is given.

    Raises:
        ConfigError: a name is unknown, or given twice.
    """
    for name in names:
        require_known(name, option, KNOBS)
    require(len(names) == len(set(names)), option, "none twice", tuple(names))
    return tuple(KNOBS[name] for name in names or KNOBS)


@dataclass(frozen=True)
class Where:
    """Conditions under which settings are measured.

    Attributes:
        input, camera_path: the scene, and its camera motion.
        seed: seed of all random numbers.
        phase: phase of the animation.
    """

    input: str
    camera_path: str
    seed: int
    phase: float


def case_of(setting: KnobSetting, where: Where, scale: Scale, base: Case) -> Case:
    """The case of a setting.

    Args:
        setting: the setting of the knobs.
        where: scene, seed and phase.
        scale: sizes, which also scale the values of knobs.
        base: a case with the values that all cases share; its scene and configuration are replaced.

    Raises:
        ConfigError: the values are inconsistent.
    """
    values = dict(setting.changes)
    fields = {KNOBS[name].field: value for name, value in setting.changes if KNOBS[name].field}
    batch, side = int(fields.pop("batch_size", ROWS[ROW][0])), ROWS[ROW][1]
    config = reduce(_with_field, fields.items(), TsarConfig(seed=where.seed))
    config = scale.sized(batch, side, config)
    shown_px, share = config.resolution_px, float(values.get("resolution", 1.0))
    return dataclasses.replace(
        base,
        input=where.input,
        camera_path=where.camera_path,
        phase=where.phase,
        policy=setting.policy,
        tsar=dataclasses.replace(config, resolution_px=int(shown_px * share)),
        parts=_named(setting.changes, "part") if setting.policy == OWN else (),
        tracing=_named(setting.changes, "tracing"),
        display_px=shown_px,
        samples_per_s=BATCHES_HZ * config.batch_size * config.samples,
    )


def _with_field(config: Any, change: tuple[str, Value]) -> Any:
    """A record with one of its fields changed; the name of a field of an inner record is dotted."""
    (name, _, rest), value = change[0].partition("."), change[1]
    return dataclasses.replace(config, **{name: _with_field(getattr(config, name), (rest, value)) if rest else value})


def _named(changes: Changes, kind: str) -> Any:
    return tuple(sorted((getattr(KNOBS[name], kind), value) for name, value in changes if getattr(KNOBS[name], kind)))
