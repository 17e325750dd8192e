"""Detection of PBRT version 4 by the words of a file.

Source: PBRT v4 file format (https://www.pbrt.org/fileformat-v4).
"""

from __future__ import annotations

import re

_LOOKED_AT = 1 << 22  # number of characters that are searched: what follows is geometry
_MATERIALS = (
    "coateddiffuse|coatedconductor|diffuse|conductor|dielectric|thindielectric|diffusetransmission|interface|measured"
)
_SIGNS = re.compile(
    rf"""^[ \t]*(?:Attribute|Option|Import|ColorSpace)\s+"|
    ^[ \t]*Film\s+"(?:rgb|gbuffer|spectral)"|
    ^[ \t]*Sampler\s+"(?:zsobol|paddedsobol|independent|pmj02bn)"|
    ^[ \t]*Integrator\s+"(?:simplepath|simplevolpath|lightpath|randomwalk|function)"|
    ^[ \t]*Material\s+"(?:{_MATERIALS})"|"string[ \t]+type"[ \t]*\[?[ \t]*"(?:{_MATERIALS})"|
    "float\s+(?:power|illuminance)"|"string\s+materials"|"(?:float|string)\s+(?:interface|conductor)\.|
    ^[ \t]*Shape\s+"bilinearmesh\"""",
    re.VERBOSE | re.MULTILINE,
)
_OLD_SIGNS = re.compile(r'^[ \t]*WorldEnd\b|^[ \t]*Film\s+"image"', re.MULTILINE)


def is_v4(text: str) -> bool:
    """Whether a text has words of version 4 only, and no ``WorldEnd`` or other word of version 3 only."""
    head = text[:_LOOKED_AT]
    return _SIGNS.search(head) is not None and _OLD_SIGNS.search(text) is None
