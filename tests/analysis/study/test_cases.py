"""Parts of a study: rows, scales, cost, and the names of results."""

from __future__ import annotations

import dataclasses

import pytest

from analysis.metrics.cost_model import adaptive_flops, admitted, nonadaptive_flops
from analysis.metrics.display_model import DisplayModel
from analysis.study.asked import require_inputs
from analysis.study.cases import ROWS, SCALES, Case, content_of, framed_config
from analysis.study.inputs import INPUTS, by_number, phase_of
from scenes import catalog
from tsar.config import ConfigError, TilingConfig, TsarConfig, tiles_at_least
from tsar.tiling import split_bounds

QUICK = SCALES["quick"]


def case(**changes) -> Case:
    values = {"input": "fly-by", "policy": "thesis", "tsar": QUICK.config(7, TsarConfig()), "scale": QUICK}
    return Case(**{**values, **changes})


def test_the_inputs_are_the_built_in_scenes() -> None:
    assert INPUTS == catalog.NAMES


@pytest.mark.parametrize("scale", SCALES.values(), ids=SCALES)
def test_every_row_at_every_scale(scale) -> None:
    """Samples per pixel, tiles per batch and cost per pixel are those of the row, whatever the scale."""
    for row, (batch, side) in enumerate(ROWS):
        config = scale.config(row, TsarConfig(seed=3))
        thesis = SCALES["thesis"].config(row, TsarConfig())
        assert (thesis.batch_size, thesis.resolution_px, thesis.sdf_side) == (batch, side, 128)
        assert config.resolution_px * scale.divisor == side and config.seed == 3
        assert config.batch_size * scale.divisor**2 == batch
        assert config.sdf_side * scale.divisor == 128 and config.cache_slots * scale.divisor**2 == thesis.cache_slots
        assert config.tile_count_max * scale.divisor**2 == thesis.tile_count_max
        assert config.resolution_px >> config.level_max == thesis.resolution_px >> thesis.level_max
        ours, theirs = case(tsar=config, scale=scale), case(tsar=thesis, scale=SCALES["thesis"])
        advantage = [nonadaptive_flops(one.cost) / adaptive_flops(one.cost) for one in (ours, theirs)]
        assert advantage[0] == pytest.approx(advantage[1], rel=0.02), "the age support is rounded to an odd number"
        assert admitted(ours.cost)


@pytest.mark.parametrize("scale", SCALES.values(), ids=SCALES)
def test_the_thesis_bound_of_512_tiles_leaves_every_row_possible(scale) -> None:
    """No tiling has 512 tiles: rows whose batch the largest below it, 511, cannot fill get the smallest that can."""
    base = TsarConfig(tiling=TilingConfig(tile_count_max=512))
    for row, (batch, _) in enumerate(ROWS):
        config = scale.config(row, base)
        bound = 512 // scale.divisor**2
        assert config.tile_count_max == (bound if batch < 512 else tiles_at_least(config.batch_size, config.level_min))
        assert split_bounds(config)[0] <= split_bounds(config)[1]


def test_small_images_get_a_smaller_coarsest_level() -> None:
    assert [SCALES[name].config(8, TsarConfig()).level_min for name in ("thesis", "half", "quick")] == [2, 1, 1]


def test_the_framed_renderer_keeps_its_rate() -> None:
    for row in (0, 1, 2):
        one = case(tsar=QUICK.config(row, TsarConfig()), framed_rate_hz=8.0)
        assert nonadaptive_flops(one.cost) / one.capacity == pytest.approx(1 / 8)
    printed = case(ledger="printed")
    assert nonadaptive_flops(printed.cost, "printed") / printed.capacity == pytest.approx(1 / 8)


def test_framed_runs_of_one_resolution_are_one_case() -> None:
    """Whatever the row; their machine is the rows' own."""
    framed = case(policy="framed", tsar=framed_config(128))
    assert framed.capacity == pytest.approx(case().capacity)
    assert framed.name.startswith("framed-fly-by-128px")


def test_a_key_names_all_that_decides_a_result() -> None:
    one = case()
    assert one.key("a") == case().key("a") and one.key("a").startswith(one.name)
    others = [
        case(phase=0.5), case(policy="afr"), case(input="chase"), case(framed_rate_hz=9.0), case(jod_span_s=(0.0, 1.0)),
        case(stills_s=(0.5,)), case(display=DisplayModel(rate_hz=120.0)), case(trace_segments=5.0), case(start_s=0.1),
        case(tsar=dataclasses.replace(one.tsar, seed=1)), case(ledger="work"),
        case(scale=dataclasses.replace(QUICK, seconds=1.0)),
    ]  # fmt: skip
    keys = {other.key("a") for other in others} | {one.key("a"), one.key("b")}
    assert len(keys) == len(others) + 2


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"input": "nowhere"}, "input"),
        ({"policy": "magic"}, "policy"),
        ({"ledger": "wall"}, "ledger.*wall"),
        ({"framed_rate_hz": 0.0}, "framed_rate_hz"),
        ({"jod_span_s": (1.0, 0.5)}, "jod_span_s"),
        ({"jod_span_s": (0.0, 9.0)}, "jod_span_s"),
        ({"tsar": TsarConfig(resolution_px=512)}, "resolution_px"),
    ],
)
def test_bad_cases_are_refused(changes, message) -> None:
    with pytest.raises(ConfigError, match=message):
        case(**changes)


def test_the_content_of_a_scene_that_was_added_decides_the_result() -> None:
    keys = []
    for name in ("plain", "glass", "plain"):
        content_of.cache_clear()  # as a study does
        with catalog.SCENES.lent(mine=lambda phase, name=name: catalog.load(name)):
            keys.append(case(input="mine").key("source"))
            assert [(one.kind, one.name) for one in case(input="mine").added] == [("scene", "mine")]
    assert keys[0] == keys[2] != keys[1]


def test_inputs_of_a_study_are_scenes_in_their_order() -> None:
    with catalog.SCENES.lent(mine=lambda phase: catalog.load("plain")):
        require_inputs(("fly-by", "mine", "glass"))
        phases = [phase_of(name, 1, 4) for name in ("fly-by", "mine", "glass", "room.pbrt")]
    assert phases == [0.25, 0.25, 0.0, 0.0]
    assert by_number(("mine", "approach", "chase", "mine")) == ["chase", "approach", "mine"]
    with pytest.raises(ConfigError, match=r"inputs: expected one of corner-exit, .*nearest: glass"):
        require_inputs(("fly-by", "glas"))
