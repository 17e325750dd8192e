"""Declaration of the glTF format."""

from scenes.formats.gltf.write import save_gltf
from scenes.formats.text.format import Format
from scenes.models.for_conversion import load_model

GLTF = Format("glTF", (".gltf", ".glb"), load_model, save_gltf)
