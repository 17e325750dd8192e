"""A ray tracer for framelet batches and whole frames, on NVIDIA Warp."""

# before anything else here touches Warp, which would otherwise announce itself on standard output
from renderer import device as _device  # noqa: F401
