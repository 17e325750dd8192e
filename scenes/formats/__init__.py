"""Formats of scene files by name: the project's own, those of installed packages, and those added from Python.

A package provides formats through entry points of the group ``tsar.scene_formats``; ``FORMATS.add(name, format)`` adds
one. All commands that take a scene file then accept files with its endings.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from tsar.named import Named

if TYPE_CHECKING:
    from scenes.formats.text.format import Format

FORMATS: Named[Format] = Named(
    "scene format",
    "tsar.scene_formats",
    {
        "pbrt": "scenes.formats.pbrt.declared:PBRT",
        "pbrt4": "scenes.formats.pbrt.declared:PBRT_4",
        "luxrender": "scenes.formats.luxrender.declared:LUXRENDER",
        "luxrender-parts": "scenes.formats.luxrender.declared:LUXRENDER_PARTS",
        "mitsuba": "scenes.formats.mitsuba.declared:MITSUBA",
        "mitsuba3": "scenes.formats.mitsuba.declared:MITSUBA_3",
        "mitsuba-dictionary": "scenes.formats.mitsuba.declared:MITSUBA_DICTIONARY",
        "luxcore": "scenes.formats.luxcore.declared:LUXCORE",
        "gltf": "scenes.formats.gltf.declared:GLTF",
        "usd": "scenes.formats.usd.declared:USD",
        "model": "scenes.models.for_conversion:MODEL",
    },
)
