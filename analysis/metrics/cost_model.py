"""Hardware-independent cost of a pipeline cycle and of a framed image, in floating point operations.

Every function evaluates on scalars and, element by element, on tensors: any parameter may be a tensor, so that a whole
grid of parameter combinations is one call.

Source: Stephens 2011, sec. 7.1.2 and table 7.1.

Deviation: two readings are forced by the surrounding text and by table 7.2. ``per_ray_tree`` is a product of segments
and cost per segment (the printed sum would hardly depend on the segments, against fig. 7.5), and
``avg_recon_overdraw``, which has no printed value, is the number of cached framelets per tile.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Literal, get_args

if TYPE_CHECKING:
    from torch import Tensor

    from tsar.config import TsarConfig
    from tsar.policy import Price

    Value = float | Tensor
else:
    # read by the command line
    Value = float

Ledger = Literal["thesis", "printed", "summed", "work", "wall"]
"""How cost is counted.

``thesis``: the model with the readings above. ``printed``: segments *plus* the cost of one segment, as printed.
``summed``: a traversal costs ``log2(tree_size)`` nodes plus one triangle instead of their product. ``work``: rays that
were counted, each priced as a segment of ``thesis``, and the modelled control stages. ``wall``: measured seconds.
"""
LEDGERS: tuple[Ledger, ...] = get_args(Ledger)
MODELLED: tuple[Ledger, ...] = ("thesis", "printed", "summed")

RAYS = ("primary_rays", "shadow_rays", "reflection_rays", "refraction_rays")
"""Counters that the ``work`` ledger prices."""

SEGMENTS_DEFAULT = 4.0
"""Ray segments of a sample, about as many as the thesis' inputs have."""

CAPACITY_DEFAULT = 8.7e10
"""FLOP/s at which the framed renderer shows 8 images a second at 512² with 4 segments under ``thesis``, rounded:
``8 * 512² * 4 * 10336 = 8.67e10``."""


@dataclass(frozen=True)
class CostParameters:
    """Independent parameters of the model, by the names of table 7.1; any may be a tensor.

    Source: Stephens 2011, table 7.1.
    """

    batch_size: Value = 128
    """Framelets rendered per cycle."""
    sdf_size: Value = 128**2
    """Elements of the density and error fields."""
    framelet_size: Value = 16**2
    """Samples in a framelet."""
    recon_res: Value = 512**2
    """Output resolution, pixels."""
    cache_size: Value = 2048
    """Framelets kept in the cache."""
    recon_age_support: Value = 128
    """Width of the age smoothing operator, pixels."""
    recon_spa_support: Value = 3**2
    """Size of the spatial reconstruction filter, pixels."""
    trace_segments: Value = 5
    """Ray segments per sample; the thesis' table says 5; its test inputs have about 4."""
    tiling_size: Value = 512
    """Framelets in the tiling."""
    dwt_coeffs: Value = 448
    """Coefficients of one framelet that contribute to the localised levelwise norm."""
    tree_size: Value = 1024
    """Nodes of the spatial structure that rays traverse."""
    avg_recon_overdraw: Value | None = None
    """Framelets drawn per output pixel; not printed in the thesis. By default ``cache_size / tiling_size``."""
    per_bvh_node: Value = 16
    """FLOPs per node visited."""
    per_triangle: Value = 64
    """FLOPs per triangle test."""
    per_shader: Value = 96
    """FLOPs per shading of a ray's end point."""

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if value is None:
                continue
            least = float(value) if isinstance(value, (int, float)) else float(value.min())
            # the left edge of fig. 7.5 is a sample that costs nothing
            ok = least > 0 or (least == 0 and item.name == "trace_segments")
            if not ok or math.isinf(least):
                raise ValueError(f"CostParameters.{item.name}: expected a positive, finite number, got {value!r}")

    @property
    def overdraw(self) -> Value:
        """Framelets drawn per output pixel."""
        return self.cache_size / self.tiling_size if self.avg_recon_overdraw is None else self.avg_recon_overdraw


def _log2(value: Value) -> Value:
    return math.log2(value) if isinstance(value, (int, float)) else value.log2()


def per_traversal(p: CostParameters, ledger: Ledger = "thesis") -> Value:
    """FLOPs to trace one ray segment, without shading."""
    if ledger == "summed":
        return _log2(p.tree_size) * p.per_bvh_node + p.per_triangle
    return _log2(p.tree_size) * p.per_bvh_node * p.per_triangle


def per_segment(p: CostParameters, ledger: Ledger = "thesis") -> Value:
    """FLOPs per ray segment: the unit price of a counted ray in the ledger ``work``, whatever the kind of ray.

    The thesis gives all segments the same price (sec. 7.1.2.2).
    """
    return per_traversal(p, ledger) + p.per_shader


def naive_per_pixel(p: CostParameters, ledger: Ledger = "thesis") -> Value:
    """FLOPs per sample, all segments (*per_ray_tree*): 51,680 with the defaults."""
    if ledger == "printed":
        return p.trace_segments + per_segment(p, ledger)
    return p.trace_segments * per_segment(p, ledger)


def error_per_framelet(p: CostParameters) -> Value:
    """FLOPs of the error estimate of one framelet: 23,744 with the defaults."""
    return (16 + 37) * p.dwt_coeffs


def reconstruction_flops(p: CostParameters) -> Value:
    """FLOPs of one reconstruction: age buffer, age smoothing, framelet filter, normalisation."""
    age_buffer = p.framelet_size * p.cache_size
    age_smooth = p.recon_res * p.recon_age_support * 4
    framelet_filter = (16 * p.recon_spa_support + 6) * p.overdraw * p.recon_res
    return age_buffer + age_smooth + framelet_filter + p.recon_res


def stage_flops(p: CostParameters, ledger: Ledger = "thesis") -> dict[str, Value]:
    """FLOPs per cycle of each stage, by the pipeline's names (*per_entry* in the thesis).

    *update* and *retiling* of the thesis are ``response`` and ``tiling``.

    For ``work`` and ``wall``, which are measured, these are the values of ``thesis``.
    """
    return {
        "selection": p.tiling_size * 1 + p.batch_size * 2,
        "tracing": p.batch_size * p.framelet_size * naive_per_pixel(p, ledger),
        "error": p.batch_size * error_per_framelet(p),
        "response": p.sdf_size * 49 + 19 + 96 * p.sdf_size,
        "tiling": p.sdf_size * 2 + 2 * p.tiling_size * _log2(p.tiling_size),
        "reconstruction": reconstruction_flops(p),
    }


def adaptive_flops(p: CostParameters, ledger: Ledger = "thesis") -> Value:
    """FLOPs of one cycle of the adaptive pipeline."""
    return sum(stage_flops(p, ledger).values())


def nonadaptive_flops(p: CostParameters, ledger: Ledger = "thesis", samples_per_axis: int = 1) -> Value:
    """FLOPs of one image of the framed renderer."""
    return p.recon_res * naive_per_pixel(p, ledger) * samples_per_axis**2


def advantage(p: CostParameters, ledger: Ledger = "thesis") -> Value:
    """Number of cycles that the adaptive pipeline completes in the time of one framed image."""
    return nonadaptive_flops(p, ledger) / adaptive_flops(p, ledger)


def admitted(p: CostParameters, ledger: Ledger = "thesis") -> Value:
    """Whether a cycle costs no more than a framed image (Stephens 2011, sec. 7.1.3)."""
    return adaptive_flops(p, ledger) <= nonadaptive_flops(p, ledger)


def work_flops(p: CostParameters, counters: Mapping[str, int]) -> float:
    """FLOPs of counted rays, each at the price of one segment under ``thesis``.

    Raises:
        ValueError: the counters have none of :data:`RAYS`.
    """
    rays = [counters[name] for name in RAYS if name in counters]
    if not rays:
        raise ValueError(f"ledger work: expected counters named {', '.join(RAYS)}, got {sorted(counters)}")
    return float(sum(rays) * per_segment(p))


def policy_flops(p: CostParameters, price: Price, ledger: Ledger = "thesis") -> Value:
    """FLOPs of one cycle of a policy: its samples, the adaptive stages if it has them, and its other work."""
    return price.samples * naive_per_pixel(p, ledger) + control_flops(p, price, ledger)


def control_flops(p: CostParameters, price: Price, ledger: Ledger = "thesis") -> Value:
    """FLOPs of one cycle of a policy without its samples."""
    stages = stage_flops(p, ledger) if price.adaptive_stages else {}
    control = sum(value for name, value in stages.items() if name != "tracing")
    return control + price.pixel_flops * p.recon_res + price.sample_flops * price.samples


def measured_parameters(p: CostParameters, counters: Mapping[str, float]) -> CostParameters:
    """Parameters with the overdraw of a cycle: the framelets accumulated at each pixel, if they were counted.

    Args:
        p: scalars.
        counters: work of one cycle, by name; ``framelet_pixels`` counts the pixels of all accumulated framelets.
    """
    drawn = counters.get("framelet_pixels", 0)
    return replace(p, avg_recon_overdraw=drawn / p.recon_res) if drawn > 0 else p


Seconds = Callable[[Mapping[str, int], float], float]


def cycle_seconds(ledger: Ledger, capacity: float, p: CostParameters, price: Price) -> Seconds:
    """Clock of a policy: ``(counters, wall_s) -> seconds`` of one cycle.

    Args:
        ledger: how cost is counted; ``wall`` returns the measured seconds, ``work`` prices the counted rays and the
            modelled control stages. Reconstruction is charged for the framelets drawn, if they are counted.
        capacity: FLOP/s of the simulated machine.
        p: scalars.
        price: price of a cycle of the policy.

    Raises:
        ValueError: the ledger is unknown, or the capacity is not positive and finite.
    """
    if ledger not in LEDGERS:
        raise ValueError(f"ledger: expected one of {', '.join(LEDGERS)}, got {ledger!r}")
    if not 0.0 < capacity < math.inf:
        raise ValueError(f"capacity: expected a positive, finite number of FLOP/s, got {capacity!r}")
    if ledger == "wall":
        return lambda counters, wall_s: wall_s
    if ledger == "work":
        return lambda counters, wall_s: (
            (work_flops(p, counters) + float(control_flops(measured_parameters(p, counters), price))) / capacity
        )
    return lambda counters, wall_s: float(policy_flops(measured_parameters(p, counters), price, ledger)) / capacity


def expected_ledger(ledger: Ledger) -> Ledger:
    """The ledger that predicts this one before a run: ``thesis`` predicts the rays that ``work`` will count."""
    return "thesis" if ledger == "work" else ledger


def parameters_of(config: TsarConfig, trace_segments: float) -> CostParameters:
    """Parameters for a configuration of the pipeline. Parameters that it does not set keep the values of table 7.1. The
    overdraw of the reconstruction is known only after a run: see :func:`measured_parameters`."""
    return CostParameters(
        batch_size=config.batch_size,
        sdf_size=config.sdf_side**2,
        framelet_size=config.samples,
        recon_res=config.pixels,
        cache_size=config.cache_slots,
        recon_age_support=config.reconstruction.age_support_px,
        trace_segments=trace_segments,
        tiling_size=config.tile_count_max,
        dwt_coeffs=6 * (config.samples - 1) // 3,
    )
