"""Planes that move in 16 and in 32 bits."""

from __future__ import annotations

import shutil

import pytest
import torch

from analysis.bench.bits import Moved, closer


@pytest.mark.skipif(not shutil.which("cc"), reason="there is no C compiler")
@pytest.mark.parametrize("bits", [16, 32])
def test_every_pixel_takes_its_source(bits: int) -> None:
    planes = Moved(80, bits)
    planes()
    assert torch.equal(planes.to, planes.origin[:, planes.source.long()])


def test_the_picture_grows_around_its_middle() -> None:
    source = closer(100).reshape(100, 100)
    assert source[0, 0] == 101 and source[50, 50] == 5050 and source[99, 99] == 9898
    assert len(set(source[0].tolist())) == 98
