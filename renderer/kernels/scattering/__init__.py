"""Scattering by surfaces along paths: one module per kind, each with its response to a direction and the sampling of
one.

Directions lie in a frame whose z axis is the shading normal on the viewer's side. A response is the scattering function
times the cosine of the incident direction, with the density with which the kind samples that direction. Perfect mirrors
and panes have no response; their directions are sampled with a weight only. :mod:`renderer.kernels.scattering.kinds`
dispatches to the kinds.
"""
