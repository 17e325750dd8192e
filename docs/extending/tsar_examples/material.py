"""A material made of those that the renderer knows: stripes of two colours under a faint mirror."""

from scenes.canonical import CheckerboardTexture, ConstantTexture, Phong


def striped(first, second, stripes: float = 12.0) -> Phong:
    """Stripes along the first texture coordinate."""
    pattern = CheckerboardTexture(ConstantTexture(first), ConstantTexture(second), (stripes, 1.0))
    return Phong(pattern, fresnel_min=0.04, fresnel_max=0.6)
