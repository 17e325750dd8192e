"""The scenes of flat layers that policies are tested on: hits lie where samples are."""

from __future__ import annotations

import torch

from tests.oracles.screens import Layer, Screen
from tsar.projection import project
from tsar.types import FrameletBatch


def test_hits_of_layers_are_seen_where_they_were_sampled() -> None:
    wheel = Layer(
        lambda u, v, t: torch.stack((u, v, t), dim=-1),
        lambda u, v, t: torch.hypot(u, v) < 0.2,
        lambda t: (3.0 * t, 0.2 * t, -0.1 * t),
    )
    floor = Layer(lambda u, v, t: torch.stack((v, u, t), dim=-1))
    screen = Screen((wheel, floor), lambda t: (0.3 * t, 0.1 * t))
    random = torch.Generator().manual_seed(0)
    position = torch.rand(4, 64, 2, generator=random)
    nothing = torch.zeros(4, dtype=torch.int64)
    hits = screen.trace(FrameletBatch(nothing, nothing, position, 0.7, hits=True)).hits
    assert hits is not None and set(hits.instance.unique().tolist()) == {0, 1}
    found, depth = project(screen.view(0.7), hits.instance, hits.point)
    assert float((found - position).abs().max()) < 1e-6 and bool((depth > 0).all())
    # a fixed point of the wheel goes on with it
    later, _ = project(screen.view(0.8), hits.instance, hits.point)
    assert float((later - found).abs().amax(-1)[hits.instance == 0].min()) > 1e-3
