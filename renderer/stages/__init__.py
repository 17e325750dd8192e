# before any module here touches Warp: this one sets how it starts
from renderer.compute import device as _device  # noqa: F401
