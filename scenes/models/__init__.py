"""Models from files, with their materials, as instances of a scene."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

from scenes.arithmetic import product
from scenes.canonical import Instance, Material, Matrix, RigidTrack, SceneError
from scenes.formats.losses import Loss, LossReport
from scenes.loading import one_line
from scenes.models.gltf_files import read_gltf
from scenes.models.model import Model
from scenes.models.obj_files import read_obj
from scenes.models.plain_files import read_plain
from scenes.models.smoothing import smoothed
from scenes.models.sources import Sources

Read = Callable[[Sources, LossReport, bool, float], Model]


def _parts_by(read: Callable[[Sources, LossReport, bool], tuple[Instance, ...]]) -> Read:
    return lambda sources, report, facets, time_s: Model(read(sources, report, facets))


def _read_usd(sources: Sources, report: LossReport, facets: bool, time_s: float) -> Model:
    from scenes.models.usd_files import read_usd  # needs the extra usd

    return read_usd(sources, report, facets, time_s)


USD_ENDINGS = (".usd", ".usda", ".usdc", ".usdz")
_READERS: dict[str, Read] = {
    ".obj": _parts_by(read_obj), ".ply": _parts_by(read_plain), ".stl": _parts_by(read_plain),
    ".glb": read_gltf, ".gltf": read_gltf, **dict.fromkeys(USD_ENDINGS, _read_usd),
}  # fmt: skip
MODEL_ENDINGS = tuple(_READERS)

_KEPT_MAX = 32
_Kept = tuple[float, Sources, Model, tuple[Loss, ...]]
_kept: dict[tuple[Path, bool, bool], _Kept] = {}
"""Cache of models at their start and at one later time, by path, facets and whether it is later; with the time and the
files on which each depends."""


def read_model(path: Path, report: LossReport | None = None, facets: bool = False) -> tuple[Instance, ...]:
    """Parts of a model, each with one material, in the file's coordinate system.

    A part without normals has flat faces, unless its file requests smoothing (smoothing groups of OBJ);
    :func:`scenes.models.smoothing.smoothed` smooths it. Materials become Phong, mirrors, panes and lamps:
    :mod:`scenes.models.mtl_files` converts those of MTL, :mod:`scenes.models.gltf_materials` those of glTF and USD.
    Vertex colours become an image (:mod:`scenes.models.vertex_colours`). Files without materials are grey (STL, most
    PLY).

    Args:
        path: OBJ, PLY, STL, GLB, glTF or USD.
        report: receives the losses.
        facets: whether materials of glTF, USD and OBJ are converted for path tracing (:mod:`scenes.models.gltf_facets`,
            :mod:`scenes.models.mtl_files`).

    Returns:
        Instances whose transforms are those of the file's nodes.

    Raises:
        SceneError: as :func:`read_whole`.
    """
    return read_whole(path, report, facets).parts


def read_whole(path: Path, report: LossReport | None = None, facets: bool = False, time_s: float = 0.0) -> Model:
    """A model with its lights and cameras.

    Args:
        path, report, facets: see :func:`read_model`.
        time_s: time since the start of the animation at which parts are shown that do not move rigidly, seconds.

    Raises:
        ModuleNotFoundError: USD needs the package usd-core.
        SceneError: the file, or a buffer of a glTF file, is missing; it has an unsupported format or cannot be read; or
            it has no faces or non-finite vertices. Pictures and material libraries that are missing are losses.
    """
    path, report = Path(path), report or LossReport()
    _, _, model, losses = _at(path, facets, 0.0)
    if model.posed and time_s != 0.0:
        _, _, model, losses = _at(path, facets, time_s)
    report.include(losses)
    return model


def files_of(path: Path, facets: bool) -> list[Path]:
    """The files that were found for a model; arguments and errors as for :func:`read_whole`."""
    return sorted(file for file, state in _at(Path(path), facets, 0.0)[1].files.items() if state is not None)


def _at(path: Path, facets: bool, time_s: float) -> _Kept:
    key = path, facets, time_s != 0.0
    kept, first = _kept.pop(key, None), _kept.get((path, facets, False))
    if kept is None or kept[0] != time_s or kept[1].changed:
        # materials, which take most of the time, are those of the first time
        sources = Sources(path) if first is None or first[1].changed else first[1]
        found = LossReport()
        model = _read(path, sources, found, facets, time_s)
        if not model.posed:
            sources.kept = None
        kept = time_s, sources, model, found.losses
    _kept[key] = kept
    if len(_kept) > _KEPT_MAX:
        del _kept[next(iter(_kept))]
    return kept


def _read(path: Path, sources: Sources, report: LossReport, facets: bool, time_s: float) -> Model:
    if path.suffix.lower() not in _READERS:
        raise SceneError(f"model {path}: expected a file that ends in {', '.join(MODEL_ENDINGS)}")
    if not path.is_file():
        raise SceneError(f"model {path}: expected a file, found none")
    try:
        model = _READERS[path.suffix.lower()](sources, report, facets, time_s)
    except ModuleNotFoundError:
        raise
    except SceneError as error:
        raise SceneError(f"model {path}: {str(error).removeprefix(f'{path}: ')}") from None
    except Exception as error:  # parsers raise arbitrary exceptions on broken files
        raise SceneError(f"model {path}: cannot be read: {one_line(error)}") from error
    if not model.parts:
        raise SceneError(f"model {path}: expected at least one face, found none")
    return model


def place_model(
    path: Path,
    to_world: Matrix,
    track: RigidTrack | None = None,
    material: Material | None = None,
    name: str = "",
    smooth_deg: float = 0.0,
) -> tuple[Instance, ...]:
    """The parts of a model, placed in the world.

    Args:
        path: see :func:`read_model`.
        to_world: transform applied outside those of the file.
        track: rigid motion of all parts.
        material: material of all parts, instead of the file's.
        name: name of the instances, instead of the file's.
        smooth_deg: greatest angle between faces, degrees, at which edges of parts without normals are smooth; 0 keeps
            faces flat.
    """
    return tuple(
        dataclasses.replace(
            part,
            to_world=product(to_world, part.to_world),
            track=track,
            material=material or part.material,
            name=name or part.name,
        )
        for part in smoothed(read_model(path), smooth_deg)
    )
