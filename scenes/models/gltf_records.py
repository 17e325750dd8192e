"""What the JSON of a glTF file must be, as far as it is read here.

Source: Khronos Group, "glTF 2.0 specification", section 5 (properties), and its extensions.
"""

from __future__ import annotations

from typing import Any

from scenes.models.json_records import Check, flag, index, items, number, numbers, one_of, record, text, whole

COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
"""Types of the components of accessors."""

WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
"""Components of an element of an accessor."""

_ATTRIBUTES = ("POSITION", "NORMAL", "COLOR_0",
               *(f"{name}_{place}" for name in ("TEXCOORD", "JOINTS", "WEIGHTS") for place in range(4)))  # fmt: skip
_LENSES = {"perspective": record({"yfov": number}, aspectRatio=number),
           "orthographic": record({"xmag": number, "ymag": number})}  # fmt: skip
_LISTS = ("accessors", "bufferViews", "buffers", "cameras", "images", "materials", "meshes", "nodes", "samplers",
          "scenes", "skins", "textures")  # fmt: skip


WHOLE = record(
    **{name: items(record()) for name in (*_LISTS, "animations")}, scene=whole(), extensionsUsed=items(text),
    extensionsRequired=items(text), extensions=record(KHR_lights_punctual=record(lights=items(record()))),
)  # fmt: skip
"""A file, whose objects are checked when they are used: what a picture does not need may be of later versions."""

LIGHT = record({"type": text}, color=numbers(3), intensity=number,
               spot=record(innerConeAngle=number, outerConeAngle=number))  # fmt: skip
"""A light of the extension KHR_lights_punctual."""


class Records:
    """The records of a checked file, whose indices lie within its lists.

    Attributes:
        of: what an object of each list must be, by the name of the list.
        sampler: what the sampler of an animation must be.
    """

    def __init__(self, json: dict[str, Any]) -> None:
        self._indices = {name: index(name, len(json.get(name, ()))) for name in _LISTS}
        self.of: dict[str, Check] = {**self._data(), **self._pictures(), **self._scene()}
        accessor = self.at("accessors")
        self.sampler = record({"input": accessor, "output": accessor},
                              interpolation=one_of("LINEAR", "STEP", "CUBICSPLINE"))  # fmt: skip

    def at(self, name: str) -> Check:
        """What an index of a list must be."""
        return self._indices[name]

    def _data(self) -> dict[str, Check]:
        view, kind = self.at("bufferViews"), one_of(*COMPONENTS)
        indices = record({"bufferView": view, "componentType": kind}, byteOffset=whole())
        sparse = {"count": whole(), "indices": indices, "values": record({"bufferView": view}, byteOffset=whole())}
        return {
            "accessors": record(
                {"componentType": kind, "count": whole(), "type": one_of(*WIDTHS)},
                bufferView=view, byteOffset=whole(), normalized=flag, sparse=record(sparse),
            ),
            "bufferViews": record(
                {"buffer": self.at("buffers"), "byteLength": whole()}, byteOffset=whole(), byteStride=whole(0, 252)
            ),
            "buffers": record(uri=text),
        }  # fmt: skip

    def _pictures(self) -> dict[str, Check]:
        source, strength = self.at("images"), record(emissiveStrength=number)
        info = {name: self._lookup(**more) for name, more in (("", {}), ("scaled", {"scale": number}))}
        rough = record(
            baseColorFactor=numbers(4), baseColorTexture=info[""], metallicFactor=number, roughnessFactor=number,
            metallicRoughnessTexture=info[""],
        )  # fmt: skip
        extensions = record(
            KHR_materials_clearcoat=record(clearcoatFactor=number, clearcoatRoughnessFactor=number),
            KHR_materials_emissive_strength=strength,
            KHR_materials_ior=record(ior=number),
            KHR_materials_specular=record(specularFactor=number),
            KHR_materials_transmission=record(transmissionFactor=number, transmissionTexture=info[""]),
            KHR_materials_unlit=record(),
            KHR_materials_volume=record(
                thicknessFactor=number, attenuationColor=numbers(3), attenuationDistance=number
            ),
        )
        material = record(
            name=text, pbrMetallicRoughness=rough, normalTexture=info["scaled"], emissiveTexture=info[""],
            emissiveFactor=numbers(3), alphaMode=text, alphaCutoff=number,
            doubleSided=flag, extensions=extensions,
        )  # fmt: skip
        return {
            "images": record(uri=text, bufferView=self.at("bufferViews")),
            "materials": material,
            "samplers": record(magFilter=whole(), minFilter=whole(), wrapS=whole(), wrapT=whole()),
            "textures": record(
                source=source, sampler=self.at("samplers"), extensions=record(EXT_texture_webp=record(source=source))
            ),
        }

    def _lookup(self, **more: Check) -> Check:
        change = record(offset=numbers(2), scale=numbers(2), rotation=number, texCoord=whole())
        extensions = record(KHR_texture_transform=change)
        return record({"index": self.at("textures")}, texCoord=whole(), extensions=extensions, **more)

    def _scene(self) -> dict[str, Check]:
        accessor, node, camera = self.at("accessors"), self.at("nodes"), self.at("cameras")
        attributes = record(**dict.fromkeys(_ATTRIBUTES, accessor))
        primitive = record(
            {"attributes": attributes}, indices=accessor, material=self.at("materials"), mode=whole(0, 6),
            targets=items(attributes),
        )  # fmt: skip
        light = record({"light": whole()})
        channel = record({"sampler": whole(), "target": record(node=node, path=text)})
        return {
            "animations": record(channels=items(channel), samplers=items(record())),
            "cameras": _camera,
            "meshes": record(name=text, primitives=items(primitive), weights=items(number)),
            "nodes": record(
                name=text, children=items(node), mesh=self.at("meshes"), skin=self.at("skins"), camera=camera,
                matrix=numbers(16), translation=numbers(3), rotation=numbers(4), scale=numbers(3),
                weights=items(number), extensions=record(KHR_lights_punctual=light),
            ),
            "scenes": record(nodes=items(node)),
            "skins": record({"joints": items(node)}, inverseBindMatrices=accessor),
        }  # fmt: skip


def _camera(value: Any) -> None:
    """A camera with the lens of its type."""
    record(name=text, type=one_of(*_LENSES))(value)
    kind = value.get("type", "perspective")
    record(**{kind: _LENSES[kind]})(value)
