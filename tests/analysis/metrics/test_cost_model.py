"""The cost model against the values and tables of the dissertation."""

from __future__ import annotations

import pytest
import torch

from analysis.metrics.cost_model import (
    CAPACITY_DEFAULT,
    CostParameters,
    adaptive_flops,
    admitted,
    advantage,
    control_flops,
    cycle_seconds,
    error_per_framelet,
    naive_per_pixel,
    nonadaptive_flops,
    parameters_of,
    per_segment,
    policy_flops,
    stage_flops,
)
from tsar.config import ReconstructionConfig, TsarConfig
from tsar.policy import Price

DEFAULT = CostParameters()

# (batch size, output side) of the sixteen rows of table 7.2
TABLE_7_2 = {
    (32, 256), (32, 512), (32, 1024), (64, 256), (64, 512), (64, 1024), (128, 256), (128, 512), (128, 1024),
    (256, 512), (256, 1024), (512, 512), (512, 1024), (768, 512), (768, 1024), (1024, 1024),
}  # fmt: skip


def test_printed_values() -> None:
    assert naive_per_pixel(DEFAULT) == 51_680
    assert error_per_framelet(DEFAULT) == 23_744
    assert naive_per_pixel(DEFAULT, "printed") == 10_341
    assert naive_per_pixel(DEFAULT, "summed") == 5 * (10 * 16 + 64 + 96)


def test_stages_by_hand() -> None:
    stages = stage_flops(DEFAULT)
    assert tuple(stages) == ("selection", "tracing", "error", "response", "tiling", "reconstruction")
    assert stages["selection"] == 512 + 256
    assert stages["tracing"] == 128 * 256 * 51_680
    assert stages["response"] == 16384 * 145 + 19
    assert stages["tiling"] == 2 * 16384 + 2 * 512 * 9
    assert stages["reconstruction"] == 256 * 2048 + 512**2 * (128 * 4 + 150 * 4 + 1)
    assert adaptive_flops(DEFAULT) == sum(stages.values())


def test_admitted_set_is_table_7_2_on_a_whole_grid() -> None:
    batch = torch.tensor([32, 64, 128, 256, 512, 768, 1024], dtype=torch.float64)[:, None]
    side = torch.tensor([256, 512, 1024], dtype=torch.float64)[None, :]
    grid = admitted(CostParameters(batch_size=batch, recon_res=side**2, trace_segments=4))
    found = {(int(batch[i, 0]), int(side[0, j])) for i, j in grid.nonzero().tolist()}
    assert found == TABLE_7_2


def test_grid_equals_scalars() -> None:
    batch = torch.tensor([32.0, 128.0, 1024.0], dtype=torch.float64)
    grid = adaptive_flops(CostParameters(batch_size=batch))
    assert grid.tolist() == [adaptive_flops(CostParameters(batch_size=b)) for b in batch.tolist()]


def test_crossing_just_below_batch_1024() -> None:
    assert admitted(CostParameters(batch_size=960))
    assert not admitted(CostParameters(batch_size=1024))
    crossing = max(b for b in range(900, 1025) if admitted(CostParameters(batch_size=b)))
    assert 980 < crossing < 1024


@pytest.mark.parametrize(
    ("overdraw", "expected"),
    [
        (None, {"thesis": 6.8, "printed": 4.3, "summed": 1.2}),
        (1, {"thesis": 7.2, "printed": 5.2, "summed": 1.8}),
    ],
)
def test_default_advantage(overdraw: float | None, expected: dict) -> None:
    """The overdraw is not printed in the thesis and moves the advantage: both readings of it are pinned."""
    p = CostParameters(avg_recon_overdraw=overdraw)
    assert {ledger: round(advantage(p, ledger), 1) for ledger in expected} == expected


def test_more_segments_approach_the_ratio_of_samples() -> None:
    """Fig. 7.5: with costly samples the advantage tends to pixels over samples per cycle."""
    assert advantage(CostParameters(trace_segments=1e9)) == pytest.approx(512**2 / (128 * 256), rel=1e-4)
    assert advantage(CostParameters(trace_segments=0)) == 0


CYCLE = Price(128 * 256, adaptive_stages=True)


def frame(p: CostParameters, samples_per_axis: int = 1) -> Price:
    return Price(int(p.recon_res) * samples_per_axis**2)


def test_default_capacity_gives_eight_frames_a_second() -> None:
    p = CostParameters(trace_segments=4)
    assert 1 / cycle_seconds("thesis", CAPACITY_DEFAULT, p, frame(p))({}, 9.0) == pytest.approx(8, rel=0.01)


@pytest.mark.parametrize("ledger", ["thesis", "printed", "summed"])
def test_a_price_says_what_the_thesis_does_of_both_renderers(ledger) -> None:
    p = CostParameters()
    assert policy_flops(p, CYCLE, ledger) == adaptive_flops(p, ledger)
    assert policy_flops(p, frame(p, 2), ledger) == nonadaptive_flops(p, ledger, 2)


def test_what_a_policy_names_beside_its_samples_is_charged() -> None:
    p, price = CostParameters(), Price(1000, pixel_flops=300.0, sample_flops=200.0)
    assert control_flops(p, price) == 300.0 * 512**2 + 200.0 * 1000
    assert policy_flops(p, price) == 1000 * naive_per_pixel(p) + control_flops(p, price)


def test_clocks() -> None:
    p = CostParameters()
    assert cycle_seconds("thesis", 2e9, p, CYCLE)({}, 9.0) == adaptive_flops(p) / 2e9
    assert cycle_seconds("wall", 2e9, p, CYCLE)({}, 9.0) == 9.0
    rays = {"primary_rays": 100, "shadow_rays": 50, "cached": 7}
    assert cycle_seconds("work", 1e6, p, frame(p))(rays, 9.0) == pytest.approx(150 * per_segment(p) / 1e6)
    control = adaptive_flops(p) - stage_flops(p)["tracing"]
    assert cycle_seconds("work", 1e6, p, CYCLE)(rays, 9.0) == pytest.approx((150 * per_segment(p) + control) / 1e6)


def test_reconstruction_is_charged_for_what_was_drawn() -> None:
    """By every ledger that models it; without a count, for what is assumed."""
    p, drawn = CostParameters(), {"framelet_pixels": 2 * 512**2, "primary_rays": 100}
    saved = (16 * 9 + 6) * (p.overdraw - 2) * 512**2
    for ledger in ("thesis", "printed", "summed", "work"):
        found, assumed = (cycle_seconds(ledger, 1.0, p, CYCLE)(c, 9.0) for c in (drawn, {"primary_rays": 100}))
        assert assumed - found == pytest.approx(saved)
    assert cycle_seconds("thesis", 1.0, p, frame(p))(drawn, 9.0) == nonadaptive_flops(p), "a framed image draws none"


def test_a_run_is_charged_for_its_own_age_support_and_coefficients() -> None:
    for side, coefficients in ((16, 6 * (64 + 16 + 4 + 1)), (32, 6 * (256 + 64 + 16 + 4 + 1))):
        config = TsarConfig(framelet_side=side, batch_size=32, reconstruction=ReconstructionConfig(33))
        p = parameters_of(config, 4.0)
        assert p.dwt_coeffs == coefficients and p.recon_age_support == 33


def test_bad_values_name_the_field() -> None:
    with pytest.raises(ValueError, match=r"CostParameters\.batch_size.*-1"):
        CostParameters(batch_size=-1)
    with pytest.raises(ValueError, match=r"recon_res"):
        CostParameters(recon_res=torch.tensor([1.0, 0.0]))
    with pytest.raises(ValueError, match=r"capacity.*0"):
        cycle_seconds("thesis", 0, CostParameters(), CYCLE)
    with pytest.raises(ValueError, match=r"ledger.*nope"):
        cycle_seconds("nope", 1.0, CostParameters(), CYCLE)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"primary_rays"):
        cycle_seconds("work", 1.0, CostParameters(), CYCLE)({}, 1.0)
