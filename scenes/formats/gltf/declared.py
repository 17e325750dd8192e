"""Declaration of the glTF format."""

from scenes.formats.gltf.read import load_gltf
from scenes.formats.gltf.write import save_gltf
from scenes.formats.text.format import Format

GLTF = Format("glTF", (".gltf", ".glb"), load_gltf, save_gltf)
