"""Memory that is reused, but never while a tensor uses it."""

from __future__ import annotations

from renderer.compute.memory import Recycled


def test_a_block_is_handed_out_again_when_nothing_lies_in_it() -> None:
    blocks = Recycled(64)
    first = blocks.block()
    where = first.data_ptr()
    part = first[8:16].view(-1)[2:]
    del first
    part.fill_(7)
    assert blocks.block().data_ptr() != where  # a part of it is still in use
    del part
    assert blocks.block().data_ptr() == where


def test_blocks_beyond_those_that_are_kept_are_new() -> None:
    blocks = Recycled(64)
    held = [blocks.block() for _ in range(2 * Recycled.KEPT)]
    assert len({block.data_ptr() for block in held}) == len(held)
    for number, block in enumerate(held):
        block.fill_(number)
    assert all((block == number).all() for number, block in enumerate(held))
