"""The canonical scene: one typed description that built-in scenes and importers produce and the renderer reads.

Conventions:

* World space is right-handed; lengths are in scene units (metres in the built-in scenes). No axis is "up".
* A transform is a ``(4, 4)`` float64 matrix acting on column vectors, object (or camera) to world.
* A camera looks along its local ``-z`` with ``+x`` to the right and ``+y`` up; image coordinates run from the top left
  corner ``(0, 0)`` to the bottom right ``(1, 1)``.
* An untransformed environment map gives direction ``(sin 2πu sin θ, cos θ, -cos 2πu sin θ)`` the texel at ``u`` from
  the left and polar angle ``θ`` from the top row.
* Colours and radiances are linear RGB with Rec. 709 primaries, float32.
* Texture coordinates have ``v = 0`` at the bottom row of the image.
"""

from scenes.canonical.cameras import Camera, EnvironmentCamera, OrthographicCamera, PerspectiveCamera, RealisticCamera
from scenes.canonical.curves import Curves
from scenes.canonical.facets import Glossy, Metal, MetallicRough, Plastic
from scenes.canonical.lights import DirectionalLight, EnvironmentLight, Light, PointLight, SpotLight, SunSky
from scenes.canonical.materials import (
    Bumped,
    Emissive,
    Glass,
    HeightField,
    Masked,
    Material,
    Matte,
    Mirror,
    MixMaterial,
    NormalMapped,
    Phong,
    Translucent,
    Uber,
)
from scenes.canonical.media import Medium
from scenes.canonical.scene import Film, Integrator, Sampler, Scene
from scenes.canonical.shapes import Cube, Disk, Instance, Mesh, Rectangle, Shape, Sphere
from scenes.canonical.textures import (
    CheckerboardTexture,
    ConstantTexture,
    ImageTexture,
    MixTexture,
    ScaleTexture,
    Texture,
)
from scenes.canonical.values import Matrix, Rgb, RigidTrack, SceneError, identity

__all__ = [
    "Bumped", "Camera", "CheckerboardTexture", "ConstantTexture", "Cube", "Curves", "DirectionalLight", "Disk",
    "Emissive", "EnvironmentCamera", "EnvironmentLight", "Film", "Glass", "Glossy", "HeightField", "ImageTexture",
    "Instance", "Integrator", "Light", "Masked", "Material", "Matrix", "Matte", "Medium", "Mesh", "Metal",
    "MetallicRough", "Mirror", "MixMaterial", "MixTexture", "NormalMapped", "OrthographicCamera", "PerspectiveCamera",
    "Phong", "Plastic", "PointLight", "RealisticCamera", "Rectangle", "Rgb", "RigidTrack", "Sampler", "ScaleTexture",
    "Scene", "SceneError", "Shape", "Sphere", "SpotLight", "SunSky", "Texture", "Translucent", "Uber", "identity",
]  # fmt: skip
