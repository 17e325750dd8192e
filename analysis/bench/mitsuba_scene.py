"""Our scenes translated to Mitsuba, as a still at one time, as closely as its plugins allow.

Geometry, framing, lights and textures are the same. Surfaces are diffuse, with one of these on top:

* a highlight without a mirror: ``roughconductor`` of ``alpha = sqrt(2 / (exponent + 2))``, which has the width of the
  Phong lobe, blended in by the colour of the highlight;
* a mirror with a Fresnel term: ``plastic`` of the index that reflects ``fresnel_min`` at normal incidence or, above
  0.15, which no dielectric reaches, a smooth conductor blended in by the mean of the term over the hemisphere. The
  highlight of the sun on a mirror is left out: a smooth mirror does not reflect a directional light.

Remaining differences: the light of the environment map replaces the constant ambient term, so paths also continue
at diffuse surfaces, and textures have no mip maps.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenes.animation import pose_at
from scenes.canonical import (
    ConstantTexture,
    DirectionalLight,
    EnvironmentLight,
    Glass,
    ImageTexture,
    Instance,
    Light,
    Masked,
    Material,
    Matrix,
    Matte,
    Mesh,
    Metal,
    Mirror,
    NormalMapped,
    PerspectiveCamera,
    Phong,
    Plastic,
    PointLight,
    Rectangle,
    RigidTrack,
    Scene,
    SceneError,
    Sphere,
    Texture,
)
from scenes.canonical.textures import WHITE

# Mitsuba's camera looks along +z with +x to the left
_CAMERA_TURN = np.diag([-1.0, 1.0, -1.0, 1.0])
_GREATEST_DIELECTRIC = 0.15  # reflectance of an index of 2.3
_SQUARE = Mesh(
    np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32),
    np.array([[0, 1, 2], [0, 2, 3]], np.int32),
    uvs=np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32),
    source="rectangle",
)


def translate(mitsuba: Any, scene: Scene, time_s: float) -> dict[str, Any]:
    """Sensor, shapes and lights as a dictionary for ``mitsuba.load_dict``.

    Args:
        mitsuba: the module, with a variant selected.
        scene: ours.
        time_s: animation time of the still.

    Raises:
        SceneError: the scene holds something that this module cannot translate.
    """
    found: dict[str, Any] = {"sensor": _sensor(mitsuba, scene, time_s)}
    for number, instance in enumerate(scene.instances):
        found[f"shape{number}"] = _shape(mitsuba, instance, time_s)
    lights = [*scene.lights, *([scene.background] if scene.background is not None else [])]
    for number, light in enumerate(lights):
        found[f"light{number}"] = _light(mitsuba, light)
    return found


def _posed(to_world: Matrix, track: RigidTrack | None, time_s: float) -> Matrix:
    return to_world if track is None else pose_at(track, time_s) @ to_world


def _sensor(mitsuba: Any, scene: Scene, time_s: float) -> dict[str, Any]:
    camera = scene.camera
    if not isinstance(camera, PerspectiveCamera):
        raise SceneError(f"camera {type(camera).__name__} has no translation, expected PerspectiveCamera")
    pose = _posed(camera.to_world, camera.track, time_s) @ _CAMERA_TURN
    return {
        "type": "perspective",
        "fov": camera.fov_deg,
        "fov_axis": "smaller",
        "near_clip": 1.0e-2,
        "far_clip": 1.0e4,
        "to_world": mitsuba.ScalarTransform4f(pose.tolist()),
    }


def _light(mitsuba: Any, light: Light) -> dict[str, Any]:
    if isinstance(light, PointLight):
        return {"type": "point", "position": list(light.position), "intensity": _rgb(light.intensity)}
    if isinstance(light, DirectionalLight):
        return {"type": "directional", "direction": list(light.direction), "irradiance": _rgb(light.irradiance)}
    if isinstance(light, EnvironmentLight):
        bitmap = mitsuba.Bitmap(np.array(light.image, np.float32))
        pose = mitsuba.ScalarTransform4f(np.asarray(light.to_world).tolist())
        return {"type": "envmap", "bitmap": bitmap, "scale": light.scale, "to_world": pose}
    raise SceneError(f"light {type(light).__name__} has no translation")


def _shape(mitsuba: Any, instance: Instance, time_s: float) -> Any:
    if isinstance(instance.shape, Sphere) or instance.emission is not None:
        return _plain_shape(mitsuba, instance, time_s)
    mesh = _SQUARE if isinstance(instance.shape, Rectangle) else instance.shape
    if not isinstance(mesh, Mesh):
        raise SceneError(f"Instance {instance.name!r}: {type(mesh).__name__} has no translation")
    pose = _posed(instance.to_world, instance.track, time_s)
    vertices = mesh.vertices @ pose[:3, :3].T + pose[:3, 3]
    properties = mitsuba.Properties()
    properties["bsdf"] = mitsuba.load_dict(_bsdf(mitsuba, instance.material))
    textured = mesh.uvs is not None
    shape = mitsuba.Mesh(
        instance.name or mesh.source,
        len(vertices),
        len(mesh.faces),
        has_vertex_normals=mesh.normals is not None,
        has_vertex_texcoords=textured,
        props=properties,
    )
    values = mitsuba.traverse(shape)
    values["vertex_positions"] = _flat(vertices)
    values["faces"] = np.ascontiguousarray(mesh.faces, np.uint32).ravel()
    if mesh.normals is not None:
        normals = mesh.normals @ np.linalg.inv(pose[:3, :3])
        values["vertex_normals"] = _flat(normals / np.linalg.norm(normals, axis=1, keepdims=True))
    if mesh.uvs is not None:
        # Mitsuba's textures have v = 0 at the top
        values["vertex_texcoords"] = _flat(np.stack([mesh.uvs[:, 0], 1.0 - mesh.uvs[:, 1]], axis=1))
    values.update()
    return shape


def _plain_shape(mitsuba: Any, instance: Instance, time_s: float) -> dict[str, Any]:
    """A sphere or rectangle, which may be a lamp."""
    if not isinstance(instance.shape, Sphere | Rectangle):
        raise SceneError(f"Instance {instance.name!r}: a lamp {type(instance.shape).__name__} has no translation")
    pose = _posed(instance.to_world, instance.track, time_s)
    found: dict[str, Any] = {"type": "rectangle"}
    if isinstance(instance.shape, Sphere):
        found = {"type": "sphere"}
        pose = pose @ np.diag([*[instance.shape.radius] * 3, 1.0])
    found |= {"to_world": mitsuba.ScalarTransform4f(pose.tolist()), "bsdf": _bsdf(mitsuba, instance.material)}
    if instance.emission is not None:
        found["emitter"] = {"type": "area", "radiance": _rgb(instance.emission)}
    return found


def _flat(values: NDArray) -> NDArray[np.float32]:
    return np.ascontiguousarray(values, np.float32).ravel()


def _rgb(value: Any) -> dict[str, Any]:
    return {"type": "rgb", "value": [float(channel) for channel in value]}


def _texture(mitsuba: Any, texture: Texture) -> dict[str, Any]:
    if isinstance(texture, ConstantTexture):
        return _rgb(texture.value)
    if not isinstance(texture, ImageTexture) or texture.wrap != "repeat":
        raise SceneError(f"texture {type(texture).__name__} has no translation")
    (scale_u, scale_v), (offset_u, offset_v) = texture.uv_scale, texture.uv_offset
    # in their picture coordinates v runs down: 1 - (v scale + offset) = (1 - v) scale + (1 - scale - offset)
    place = [[scale_u, 0.0, offset_u], [0.0, scale_v, 1.0 - scale_v - offset_v], [0.0, 0.0, 1.0]]
    return {
        "type": "bitmap",
        "bitmap": mitsuba.Bitmap(np.array(texture.image, np.float32)),
        "raw": True,
        "to_uv": mitsuba.ScalarTransform3f(place),
    }


def _bsdf(mitsuba: Any, material: Material) -> dict[str, Any]:
    """A material, two-sided as our surfaces are, except for glass and holes, which transmit light."""
    if isinstance(material, Glass):
        return _glass(mitsuba, material)
    if isinstance(material, Masked):
        if material.cutoff is not None:
            raise SceneError("holes by an alpha cutoff have no translation")
        inner = _bsdf(mitsuba, material.base)
        return {"type": "mask", "opacity": _texture(mitsuba, material.opacity), "nested": inner}
    if isinstance(material, NormalMapped):
        normals = _texture(mitsuba, material.normals)
        return {"type": "normalmap", "normalmap": normals, "nested": _bsdf(mitsuba, material.base)}
    return {"type": "twosided", "inner": _one_side(mitsuba, material)}


def _glass(mitsuba: Any, material: Glass) -> dict[str, Any]:
    kind = "thindielectric" if material.thin else "roughdielectric" if max(material.roughness) > 0.0 else "dielectric"
    found: dict[str, Any] = {"type": kind, "int_ior": material.ior, "ext_ior": 1.0}
    for name, texture in (("reflectance", material.reflectance), ("transmittance", material.transmittance)):
        if texture is not WHITE:
            found[f"specular_{name}"] = _texture(mitsuba, texture)
    rough = {"distribution": material.distribution, "alpha": material.roughness[0]}
    return found | (rough if kind == "roughdielectric" else {})


def _coated(mitsuba: Any, material: Plastic) -> dict[str, Any]:
    found = {"type": "roughplastic" if material.roughness > 0.0 else "plastic", "int_ior": material.ior, "ext_ior": 1.0}
    found["diffuse_reflectance"] = _texture(mitsuba, material.diffuse)
    rough = {"distribution": material.distribution, "alpha": material.roughness}
    return found | (rough if material.roughness > 0.0 else {})


def _metal(mitsuba: Any, material: Metal) -> dict[str, Any]:
    found: dict[str, Any] = {"type": "conductor", "eta": _rgb(material.eta), "k": _rgb(material.k)}
    found["specular_reflectance"] = _texture(mitsuba, material.reflectance_scale)
    rough = {"type": "roughconductor", "distribution": material.distribution, "alpha": material.roughness[0]}
    return found | (rough if max(material.roughness) > 0.0 else {})


def _one_side(mitsuba: Any, material: Material) -> dict[str, Any]:
    if isinstance(material, Metal):
        return _metal(mitsuba, material)
    if isinstance(material, Plastic):
        return _coated(mitsuba, material)
    if isinstance(material, Mirror):
        mirror = {"type": "conductor", "material": "none"}
        return mirror | {"specular_reflectance": _texture(mitsuba, material.reflectance)}
    if isinstance(material, Matte):
        return {"type": "diffuse", "reflectance": _texture(mitsuba, material.reflectance)}
    if not isinstance(material, Phong):
        raise SceneError(f"material {type(material).__name__} has no translation")
    reflectance = _texture(mitsuba, material.diffuse)
    diffuse = {"type": "diffuse", "reflectance": reflectance}
    if material.fresnel_max > _GREATEST_DIELECTRIC >= material.fresnel_min:
        root = max(material.fresnel_min, 0.005) ** 0.5
        return {"type": "plastic", "diffuse_reflectance": reflectance, "int_ior": (1.0 + root) / (1.0 - root)}
    if material.fresnel_max > 0.0:
        mirror = {"type": "conductor", "material": "none", "specular_reflectance": _rgb(material.mirror_tint)}
        return {"type": "blendbsdf", "weight": mean_reflectance(material), "below": diffuse, "above": mirror}
    gloss = float(np.mean(material.specular))
    if gloss == 0.0:
        return diffuse
    lobe = {"type": "roughconductor", "material": "none", "alpha": (2.0 / (material.exponent + 2.0)) ** 0.5}
    return {"type": "blendbsdf", "weight": gloss, "below": diffuse, "above": lobe}


def mean_reflectance(material: Phong) -> float:
    """Mean of the Fresnel term over the hemisphere, weighted by the cosine.

    The integral of ``2 c (1 - c)^n`` over ``c`` in [0, 1] is ``2 / ((n + 1)(n + 2))``.
    """
    n = material.fresnel_exponent
    share = 2.0 / ((n + 1.0) * (n + 2.0))
    return material.fresnel_min + (material.fresnel_max - material.fresnel_min) * share
