"""What the JSON of a glTF file must be, as far as it is read here.

Source: Khronos Group, "glTF 2.0 specification", section 5 (properties), and its extensions.
"""

from __future__ import annotations

from typing import Any

from scenes.models.json_records import Check, flag, index, items, named, number, numbers, one_of, record, text, whole

COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
"""Types of the components of accessors."""

WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
"""Components of an element of an accessor."""

_LISTS = ("accessors", "bufferViews", "buffers", "cameras", "images", "materials", "meshes", "nodes", "samplers",
          "scenes", "skins", "textures")  # fmt: skip


class _Records:
    """The records of a file, whose indices lie within its lists."""

    def __init__(self, counts: dict[str, int]) -> None:
        self._indices = {name: index(name, count) for name, count in counts.items()}

    def at(self, name: str) -> Check:
        return self._indices[name]

    def whole(self) -> Check:
        made: dict[str, Check] = {**self._data(), **self._pictures(), **self._scene()}
        lists = {name: items(item) for name, item in made.items()}
        names = items(text)
        return record(
            **lists, scene=whole(), extensionsUsed=names, extensionsRequired=names,
            extensions=record(KHR_lights_punctual=record(lights=items(_light()))),
        )  # fmt: skip

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
            KHR_materials_transmission=record(transmissionFactor=number),
            KHR_materials_unlit=record(),
            KHR_materials_volume=record(thicknessFactor=number, attenuationColor=numbers(3)),
        )
        material = record(
            name=text, pbrMetallicRoughness=rough, normalTexture=info["scaled"], emissiveTexture=info[""],
            emissiveFactor=numbers(3), alphaMode=one_of("OPAQUE", "MASK", "BLEND"), alphaCutoff=number,
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
        primitive = record(
            {"attributes": named(accessor)},
            indices=accessor, material=self.at("materials"), mode=whole(0, 6), targets=items(named(accessor)),
        )  # fmt: skip
        light = record({"light": whole()})
        sampler = record({"input": accessor, "output": accessor},
                         interpolation=one_of("LINEAR", "STEP", "CUBICSPLINE"))  # fmt: skip
        channel = record({"sampler": whole(), "target": record(node=node, path=text)})
        return {
            "animations": record(channels=items(channel), samplers=items(sampler)),
            "cameras": record(
                name=text, type=one_of("perspective", "orthographic"),
                perspective=record({"yfov": number}, aspectRatio=number),
                orthographic=record({"xmag": number, "ymag": number}),
            ),
            "meshes": record(name=text, primitives=items(primitive)),
            "nodes": record(
                name=text, children=items(node), mesh=self.at("meshes"), skin=self.at("skins"), camera=camera,
                matrix=numbers(16), translation=numbers(3), rotation=numbers(4), scale=numbers(3),
                extensions=record(KHR_lights_punctual=light),
            ),
            "scenes": record(nodes=items(node)),
            "skins": record({"joints": items(node)}, inverseBindMatrices=accessor),
        }  # fmt: skip


def _light() -> Check:
    spot = record(innerConeAngle=number, outerConeAngle=number)
    return record({"type": text}, color=numbers(3), intensity=number, spot=spot)


def record_of(json: dict[str, Any]) -> Check:
    """What an object of this many nodes, meshes and the like must be."""
    counts = {name: len(json[name]) if isinstance(json.get(name), list) else 0 for name in _LISTS}
    return _Records(counts).whole()
