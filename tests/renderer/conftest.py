"""Kernels are compiled once, before the first test that needs them."""

from __future__ import annotations

import pytest

from renderer.compute import device
from renderer.kernels import entry as kernels
from renderer.kernels import packets
from renderer.trace import Renderer
from tests.renderer.builders import driving_scene


@pytest.fixture(scope="session", autouse=True)
def warm_kernels() -> None:
    device.load_kernels([kernels, packets], "cpu")


@pytest.fixture(scope="session")
def driving() -> Renderer:
    """A renderer of the driving scene on two threads."""
    return Renderer(driving_scene(), threads=2)
