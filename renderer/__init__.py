"""A ray tracer for framelet batches and whole frames, on NVIDIA Warp."""

# before any other module here touches Warp: this one sets how it starts
from renderer.compute import device as _device  # noqa: F401
