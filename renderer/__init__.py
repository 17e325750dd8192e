"""A ray tracer for framelet batches and whole frames, on NVIDIA Warp.

It exports the names of its modules that others use; each is imported at its first access.
"""

from typing import TYPE_CHECKING

from tsar.lazy import lazily

if TYPE_CHECKING:
    from renderer.film.files import write_image as write_image
    from renderer.render import render as render
    from renderer.sampling import POINT_SETS as POINT_SETS
    from renderer.sampling.plan import SamplePlan as SamplePlan
    from renderer.trace import Renderer as Renderer

__getattr__, __dir__ = lazily(
    __name__,
    {
        "renderer.film.files": "write_image",
        "renderer.render": "render",
        "renderer.sampling": "POINT_SETS",
        "renderer.sampling.plan": "SamplePlan",
        "renderer.trace": "Renderer",
    },
)
