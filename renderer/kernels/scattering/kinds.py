"""All kinds of surfaces: the parameters of a point, its response, and the sampling of a direction."""

from __future__ import annotations

import warp as wp

from renderer.kernels.scattering.coated import coated_chosen, coated_response
from renderer.kernels.scattering.diffuse import diffuse_response
from renderer.kernels.scattering.distributions import normal_of
from renderer.kernels.scattering.glass import glass_chosen, glass_response
from renderer.kernels.scattering.lobes import Chosen, Lobes, Response, cosine_direction, mirrored
from renderer.kernels.scattering.metal import metal_reflectance, metal_response
from renderer.kernels.scattering.metallic import metallic_chosen, metallic_response
from renderer.kernels.scattering.phong import mirror_chosen, phong_chosen, phong_response
from renderer.kernels.textures import texture_color
from renderer.layout.features import Feature
from renderer.layout.kinds import ScatterKind
from renderer.layout.path_sizes import ALPHA_LEAST
from renderer.layout.scattering import ScatterRecord
from renderer.layout.structs import MaterialRecord, SceneData, Surface


@wp.func
def looked_up(
    features: wp.int32, scene: SceneData, texture: wp.int32, surface: Surface, footprint: wp.float32
) -> wp.vec3:
    """Colour of a texture at a surface; white without a texture."""
    if texture < 0:
        return wp.vec3(1.0, 1.0, 1.0)
    return texture_color(features, scene, texture, surface.uv, footprint)


@wp.func
def lobes_at(
    features: wp.int32,
    scene: SceneData,
    surface: Surface,
    record: ScatterRecord,
    material: MaterialRecord,
    cosine: wp.float32,
    footprint: wp.float32,
) -> Lobes:
    """Scattering parameters of a surface for a viewing direction with this cosine to its normal."""
    lobes = Lobes()
    lobes.kind = record.kind
    lobes.base = looked_up(features, scene, record.base, surface, footprint)
    lobes.specular = looked_up(features, scene, record.specular, surface, footprint)
    lobes.rough = record.rough
    lobes.alpha = record.alpha
    lobes.beckmann = record.beckmann
    lobes.cos_spread = material.cos_spread
    lobes.thin = record.thin
    lobes.ratio = 1.0 / record.ior
    if record.kind == ScatterKind.PHONG:
        grazing = wp.pow(wp.clamp(1.0 - cosine, 0.0, 1.0), material.fresnel_exponent)
        share = material.fresnel_min + (material.fresnel_max - material.fresnel_min) * grazing
        lobes.base = lobes.base * (1.0 - share)
        lobes.through = material.mirror_tint * share
        lobes.specular = material.specular
        lobes.exponent = material.exponent
    elif record.kind == ScatterKind.GLASS:
        lobes.through = lobes.base
        if surface.inside and record.thin == 0:
            lobes.ratio = record.ior
    elif (features & Feature.FACETS) != 0:
        lobes.eta = record.eta
        lobes.k = record.k
        lobes.inner = record.inner
        lobes.passed_low = record.passed_low
        lobes.passed_high = record.passed_high
        if record.kind == ScatterKind.METALLIC:
            parts = looked_up(features, scene, record.parts, surface, footprint)
            roughness = wp.clamp(record.roughness * parts[1], 0.0, 1.0)
            lobes.alpha = wp.max(roughness * roughness, ALPHA_LEAST)
            lobes.metallic = wp.clamp(record.metallic * parts[2], 0.0, 1.0)
            lobes.clear = record.clear
            lobes.clear_alpha = record.clear_alpha
    return lobes


@wp.func
def response_of(features: wp.int32, lobes: Lobes, outgoing: wp.vec3, arriving: wp.vec3) -> Response:
    """The response of a surface that is lit from a direction, without perfect reflection and refraction."""
    if lobes.kind == ScatterKind.DIFFUSE:
        return diffuse_response(lobes, outgoing, arriving)
    if lobes.kind == ScatterKind.PHONG:
        return phong_response(lobes, outgoing, arriving)
    if (features & Feature.FACETS) != 0:
        if lobes.kind == ScatterKind.GLASS:
            return glass_response(lobes, outgoing, arriving)
        if lobes.kind == ScatterKind.METAL and lobes.alpha > 0.0:
            return metal_response(lobes, outgoing, arriving)
        if lobes.kind == ScatterKind.COATED:
            return coated_response(lobes, outgoing, arriving)
        if lobes.kind == ScatterKind.METALLIC:
            return metallic_response(lobes, outgoing, arriving)
    return Response()


@wp.func
def chosen_of(features: wp.int32, lobes: Lobes, outgoing: wp.vec3, choice: wp.float32, point: wp.vec2) -> Chosen:
    """A sampled direction and its weight; a weight of zero ends the path."""
    chosen = Chosen()
    chosen.squeeze = 1.0
    if lobes.kind == ScatterKind.DIFFUSE:
        chosen.direction = cosine_direction(point)
        chosen.density = 1.0
    elif lobes.kind == ScatterKind.PHONG:
        chosen = phong_chosen(lobes, outgoing, choice, point)
    elif lobes.kind == ScatterKind.MIRROR:
        chosen = mirror_chosen(lobes, outgoing, lobes.specular, point)
    elif lobes.kind == ScatterKind.GLASS:
        chosen = glass_chosen(lobes, outgoing, choice, point)
    elif (features & Feature.FACETS) != 0:
        if lobes.kind == ScatterKind.METAL and lobes.alpha > 0.0:
            chosen.direction = mirrored(outgoing, normal_of(lobes, outgoing, point))
            chosen.density = 1.0
        elif lobes.kind == ScatterKind.METAL:
            chosen.direction = mirrored(outgoing, wp.vec3(0.0, 0.0, 1.0))
            chosen.weight = metal_reflectance(lobes, outgoing[2])
        elif lobes.kind == ScatterKind.COATED:
            chosen = coated_chosen(lobes, outgoing, choice, point)
        elif lobes.kind == ScatterKind.METALLIC:
            chosen = metallic_chosen(lobes, outgoing, choice, point)
    if chosen.density > 0.0:
        response = response_of(features, lobes, outgoing, chosen.direction)
        chosen.density = response.density
        chosen.weight = wp.vec3(0.0, 0.0, 0.0)
        if response.density > 0.0:
            chosen.weight = response.value / response.density
    return chosen
