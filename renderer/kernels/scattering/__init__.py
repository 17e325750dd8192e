"""How surfaces scatter light along paths: a file a kind, each with the response to a direction and the choice of one.

Directions lie in a frame whose z axis is the shading normal on the viewer's side. A response is the scattering function
times the cosine of the arriving direction, with the density by which the kind chooses that direction; perfect mirrors
and panes have none, and are chosen with a weight alone. :mod:`renderer.kernels.scattering.kinds` brings them together.
"""
