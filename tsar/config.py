"""Configuration: one frozen dataclass per stage, composed into :class:`TsarConfig`. Imports nothing large, so that a
command line can be made from it quickly."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import log2
from typing import Literal

from tsar.checks import ConfigError, closed_choices, require
from tsar.choices import NORMS, RECONSTRUCTIONS, SOLVERS
from tsar.window import Window

__all__ = [
    "ConfigError",
    "ErrorConfig",
    "ReconstructionConfig",
    "ResponseConfig",
    "StagesName",
    "TilingConfig",
    "TsarConfig",
    "closed_choices",
    "require",
    "tiles_at_least",
    "tiles_at_most",
]

RESOLUTION_DEFAULT = 512
SIDE_MOST = 16384
"""Greatest side of an output image, pixels."""

StagesName = Literal["compiled", "reference"]
"""Implementation of the stages around tracing: CPU kernels, or the tensor operations they are checked against."""


def tiles_at_most(count: int, level_min: int) -> int:
    """The largest tiling of at most ``count`` tiles: ``4^level_min`` tiles and three more for every split."""
    coarse = 4**level_min
    return coarse + (count - coarse) // 3 * 3


def tiles_at_least(count: int, level_min: int) -> int:
    """The smallest tiling of at least ``count`` tiles."""
    return max(4**level_min, tiles_at_most(count + 2, level_min))


@dataclass(frozen=True)
@closed_choices("tiling.")
class TilingConfig:
    """Bounds of the tiling of the policy thesis (Stephens 2011, sec. 4.1.6)."""

    level_min: int = 2
    """Coarsest quad level: tiles are at most 1/2^level_min of the image wide."""
    level_max: int = 0
    """Finest quad level; 0 means that of rate_max."""
    tile_count_max: int = 0
    """Maximum number of tiles in a tiling; 0 means max(512, 4 * batch size): 512, as in the thesis, at its batch size
    of 128. A tiling has 4^level_min + 3 k tiles, so one of at most 512 has 511; it must hold a batch."""
    threshold_samples: float = 0.0
    """A tile is split while the samples requested in it exceed this; 0 means as many as a framelet holds."""
    rate_max: int = 0
    """Most samples along a pixel's side, a power of two up to 8; 4 is the greatest rate of the thesis (sec. 5.1.2). 0
    means 2, or less where a tile would be smaller than a field element. Not to be combined with level_max."""

    def __post_init__(self) -> None:
        require(1 <= self.level_min <= 9, "tiling.level_min", "between 1 and 9", self.level_min)
        require(0 <= self.level_max <= 9, "tiling.level_max", "between 0 and 9", self.level_max)
        require(self.tile_count_max >= 0, "tiling.tile_count_max", "at least 0", self.tile_count_max)
        require(self.rate_max in (0, 1, 2, 4, 8), "tiling.rate_max", "1, 2, 4 or 8, or 0", self.rate_max)
        only_one = not (self.rate_max and self.level_max)
        require(only_one, "tiling.rate_max", "0 beside a level_max, which sets the rate", self.rate_max)
        threshold = self.threshold_samples
        ok = threshold == 0 or 1e-6 <= threshold <= 1e12
        require(ok, "tiling.threshold_samples", "0 or a number in [1e-6, 1e12]", threshold)


@dataclass(frozen=True)
@closed_choices("error.")
class ErrorConfig:
    """The error estimate of the policy thesis and its template: log2 power = offset + slope * octave, octave 0 the
    coarsest (sec. 5.3.3)."""

    spatial_offset: float = -7.0
    """log2 of the power tolerated per coefficient at the coarsest spatial octave (compressed luminance squared)."""
    spatial_slope: float = -1.0
    """Slope of the template over spatial octaves; steeper is more sensitive. The thesis sweeps to -8.6."""
    temporal_offset: float = -9.0
    """As spatial_offset, for the temporal octants."""
    temporal_slope: float = -1.0
    """Slope of the template over temporal octaves; the thesis sweeps to -9.6."""
    norm: str = "l2"
    """Levelwise norm: l2 (total power), linf (the greatest power of one coefficient), or one that was added."""
    form: Literal["contrast", "difference"] = "contrast"
    """Error from the powers S of the signal and T of the template: contrast is (S - T) / (S + T), difference is
    log2(S/T) / 8, clamped to [-1, 1]."""
    octaves: Literal["greatest", "sum"] = "sum"
    """How octaves are compared with the template: greatest compares each octave and takes the greatest error; sum
    compares the sums of their powers, for which offset and slope act as one parameter."""
    extent: Literal["element", "tile"] = "element"
    """The part of a tile whose power is summed before it is compared: an element of the field, or the whole tile."""
    estimator: Literal["dwt", "variance", "fft"] = "dwt"
    """Estimator of the power: the streaming wavelet transform, the variance of samples (sec. 5.2), or a windowed
    Fourier transform of a tile's last eight updates (sec. 5.3.1); the norm applies to the wavelet transform only."""

    def __post_init__(self) -> None:
        NORMS.require(self.norm, "error.norm")
        for name in ("spatial_offset", "spatial_slope", "temporal_offset", "temporal_slope"):
            value = getattr(self, name)
            require(-60.0 <= value <= 60.0, f"error.{name}", "a number in [-60, 60]", value)


@dataclass(frozen=True)
@closed_choices("response.")
class ResponseConfig:
    """The control decision of the policy thesis (chapter 6)."""

    solver: str = "waterfill"
    """Solver of density transport; it distributes freed density: waterfill, slow_greater, scale_lesser, square,
    descend, diffusion, trivial, or one that was added."""
    gain: float = 1.0
    """Distance moved in normalised density space per unit error (eq. 6.11 has 1), in [1e-6, 1e6]."""
    bias: float = 0.0
    """Octaves towards space, negative towards time; each decision moves by them along the iso-product curve."""
    surplus_max: float = 1.0
    """Bound of the running surplus C as a share of the budget; at 1 a static, plain picture frees as much as it can."""
    temporal_min: float = 1.0 / 16.0
    """Least temporal density, refreshes per cycle, in [1e-6, 1]: even a static tile is refreshed this often. A batch
    must hold the coarsest tiling at this rate."""

    def __post_init__(self) -> None:
        SOLVERS.require(self.solver, "response.solver")
        require(1e-6 <= self.gain <= 1e6, "response.gain", "a number in [1e-6, 1e6]", self.gain)
        require(-8.0 <= self.bias <= 8.0, "response.bias", "a number in [-8, 8]", self.bias)
        require(0 <= self.surplus_max <= 1, "response.surplus_max", "a share in [0, 1]", self.surplus_max)
        require(1e-6 <= self.temporal_min <= 1, "response.temporal_min", "a density in [1e-6, 1]", self.temporal_min)


@dataclass(frozen=True)
@closed_choices("reconstruction.")
class ReconstructionConfig:
    """Image reconstruction of the policy thesis (sec. 4.2)."""

    age_support_px: int = 9
    """Width of the one-sided smoothing of the age field, output pixels, odd; 1 switches it off. The thesis uses 128."""
    method: str = "blend"
    """How cached framelets become an image: blend, or one that was added."""

    def __post_init__(self) -> None:
        RECONSTRUCTIONS.require(self.method, "reconstruction.method")
        ok = self.age_support_px >= 1 and self.age_support_px % 2 == 1
        require(ok, "reconstruction.age_support_px", "an odd number of pixels, at least 1", self.age_support_px)


@dataclass(frozen=True)
@closed_choices()
class TsarConfig:
    """Everything that determines a run of the pipeline, given the renderer and the cost of a cycle."""

    batch_size: int = 128
    """Framelets rendered per cycle."""
    resolution_px: int = RESOLUTION_DEFAULT
    """Width and height of the pictures, pixels, a power of two; not to be combined with width_px and height_px, from
    which it then follows as the least that holds both."""
    width_px: int = 0
    """Width, pixels; 16 to 16384, of a picture of any shape; 0 for a square of resolution_px."""
    height_px: int = 0
    """Height, pixels; given where width_px is."""
    framelet_side: int = 16
    """Samples along a framelet's side, 16 or 32."""
    sdf_side: int = 128
    """Elements along a side of the density and error fields of the policy thesis, a power of two."""
    cache_size: int = 2048
    """Framelets kept in the cache; of the policy thesis, and more for batches above a quarter of it."""
    seed: int = 0
    """Seed of all random numbers; also of the phase in which tiles first fall due."""
    warmup_cycles: int = 48
    """Cycles run before the start time, so that measurement begins in the steady state."""
    tiling: TilingConfig = field(default_factory=TilingConfig)
    error: ErrorConfig = field(default_factory=ErrorConfig)
    response: ResponseConfig = field(default_factory=ResponseConfig)
    reconstruction: ReconstructionConfig = field(default_factory=ReconstructionConfig)

    def __post_init__(self) -> None:
        require(1 <= self.batch_size <= 8192, "batch_size", "between 1 and 8192 framelets", self.batch_size)
        if self.width_px or self.height_px:
            self._follow_shape()
        for name, low, high in (("resolution_px", 64, SIDE_MOST if self.width_px else 8192), ("sdf_side", 16, 512)):
            value = getattr(self, name)
            ok = low <= value <= high and value & (value - 1) == 0
            require(ok, name, f"a power of two in [{low}, {high}]", value)
        require(self.framelet_side in (16, 32), "framelet_side", "16 or 32", self.framelet_side)
        for name, most in (("cache_size", 2**20), ("warmup_cycles", 100_000), ("seed", 2**32 - 1)):
            require(0 <= getattr(self, name) <= most, name, f"between 0 and {most}", getattr(self, name))
        low, high = self.level_min, self.level_max
        if rate := self.tiling.rate_max:
            side = self.resolution_px * rate // self.framelet_side
            require(2**low <= side, "tiling.rate_max", f"one that tiles of level {low} do not exceed", rate)
            ok = side <= self.sdf_side
            require(ok, "tiling.rate_max", f"at most {rate * self.sdf_side // side} at sdf_side {self.sdf_side}", rate)
        require(low <= high <= self.field_level, "tiling.level_max", f"between {low} and {self.field_level}", high)
        require(2**high <= self.resolution_px // 2, "tiling.level_max", "tiles of at least two output pixels", high)
        self._require_room_for_a_batch(4**low, 4**high)
        support = self.reconstruction.age_support_px
        require(support < self.resolution_px, "reconstruction.age_support_px", "less than resolution_px", support)
        require(self.cache_size >= self.batch_size, "cache_size", "at least one batch", self.cache_size)

    def _follow_shape(self) -> None:
        """Sets the resolution to the least power of two that holds the picture's sides."""
        for name in sorted(("width_px", "height_px"), key=lambda name: getattr(self, name) == 0):  # given sides first
            value = getattr(self, name)
            require(16 <= value <= SIDE_MOST, name, f"between 16 and {SIDE_MOST}, as both sides are given", value)
        side = max(64, 1 << (max(self.width_px, self.height_px) - 1).bit_length())
        given = self.resolution_px
        require(given in (RESOLUTION_DEFAULT, side), "resolution_px", "none beside width_px and height_px", given)
        object.__setattr__(self, "resolution_px", side)

    def _require_room_for_a_batch(self, coarse: int, fine: int) -> None:
        """Refuses tilings too small for a full batch, and densities whose least sum exceeds the budget."""
        count, size = self.tile_count_max, self.batch_size
        if size == TsarConfig.batch_size:  # the default, not a choice of the caller
            needs = f"room for a batch of {size} tiles (it has {fine}; --batch-size {fine} fits)"
            require(size <= fine, "resolution_px", needs, self.resolution_px)
        require(size <= fine, "batch_size", f"at most {fine} (all tiles of the finest level)", size)
        least = tiles_at_least(size, self.level_min)
        needs = f"between {least} (a tiling has {coarse} + 3 k tiles, and every batch must be full) and {fine}"
        require(least <= count <= fine, "tiling.tile_count_max", f"{needs} (all tiles of the finest level)", count)
        rate = self.response.temporal_min
        needs = f"at most {size / coarse:g} (a batch of {size} for the {coarse} tiles of the coarsest level)"
        require(rate * coarse <= size, "response.temporal_min", needs, rate)

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the output image, pixels."""
        return self.height_px or self.resolution_px, self.width_px or self.resolution_px

    @property
    def pixels(self) -> int:
        """Number of pixels of the output image."""
        return self.shape[0] * self.shape[1]

    @property
    def window(self) -> Window:
        """Where the output image lies on the square plane that policies work on."""
        height, width = self.shape
        return Window(width, height, self.resolution_px)

    @property
    def field_level(self) -> int:
        """Quad level at which a tile is one field element."""
        return int(log2(self.sdf_side))

    def elements_of(self, level: int) -> int:
        """Number of field elements that a tile of a quad level covers, at least 1."""
        return 4 ** max(self.field_level - level, 0)

    @property
    def samples(self) -> int:
        """Samples per framelet, s * s."""
        return self.framelet_side**2

    @property
    def level_min(self) -> int:
        return self.tiling.level_min

    @property
    def level_max(self) -> int:
        auto = int(log2(self.resolution_px * (self.tiling.rate_max or 2) / self.framelet_side))
        return self.tiling.level_max or max(self.level_min, min(auto, self.field_level))

    @property
    def threshold_samples(self) -> float:
        """Number of samples requested in a tile above which the tile is split."""
        return self.tiling.threshold_samples or float(self.samples)

    @property
    def tile_count_max(self) -> int:
        auto = min(max(512, 4 * self.batch_size, 4**self.level_min), 4**self.level_max)
        return self.tiling.tile_count_max or auto

    @property
    def cache_slots(self) -> int:
        """Number of cache slots: at least four times the largest tiling, as in table 7.1."""
        return max(self.cache_size, 4 * self.tile_count_max)

    @property
    def budget(self) -> float:
        """Samples per cycle: sum(θ_s θ_t) + C stays equal to this."""
        return float(self.batch_size * self.samples)

    @property
    def spatial_bounds(self) -> tuple[float, float]:
        """Least and greatest θ_s, samples per element, of the coarsest and finest tile."""
        per_image = self.samples / self.sdf_side**2
        return per_image * 4**self.level_min, per_image * 4**self.level_max

    @property
    def temporal_bounds(self) -> tuple[float, float]:
        """Least and greatest θ_t, refreshes per cycle."""
        return self.response.temporal_min, 1.0
