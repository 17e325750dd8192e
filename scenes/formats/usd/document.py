"""A USD file that is being written: its stage, its names and its pictures.

Source: OpenUSD documentation, UsdGeom and UsdShade; "Usdz File Format Specification".
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from scenes.canonical import ImageTexture, SceneError
from scenes.canonical.values import Matrix
from scenes.formats.appearance.pictured import as_file, in_bytes, number_codes, srgb_codes
from scenes.formats.text.output import Output
from scenes.models.usd_library import Gf, Sdf, Tf, Usd, UsdGeom, Vt

Part = TypeVar("Part")

ROOT = "/World"
RATE = 24.0
"""Time codes per second."""

_SIDE_SHARP = 256
_SIBLINGS = 256
_ALIGNED, _HEADER = 64, 30  # bytes to which files in a package are aligned, and of a header before its name
_UNMOVED = np.eye(4)
_FIRST_DATE = (1980, 1, 1, 0, 0, 0)


class UsdStage:
    """Collects the prims of a file; what is equal is written once.

    Args:
        output: receives the files.
        target: the file as messages name it.
        up: upward axis, ``Y`` or ``Z``.

    Attributes:
        stage: the stage, in memory.
    """

    def __init__(self, output: Output, target: Path, up: str) -> None:
        self.output, self.target = output, target
        self.stage: Any = Usd.Stage.CreateInMemory()
        UsdGeom.SetStageUpAxis(self.stage, up)
        UsdGeom.SetStageMetersPerUnit(self.stage, 1.0)
        self.stage.SetDefaultPrim(UsdGeom.Xform.Define(self.stage, ROOT).GetPrim())
        self._numbers: dict[str, int] = {f"{ROOT}/{name}": 0 for name in ("Materials", "Prototypes")}
        self._counts: dict[str, int] = {}
        self._groups: dict[str, str] = {}
        self._made: dict[Any, tuple[object, Any]] = {}
        self._waiting: list[tuple[str, str, Matrix]] = []

    def path(self, name: str, below: str = ROOT) -> str:
        """A path that no prim has yet, below another; of many prims, which cost the library a time that grows with the
        square of their number, every 256 lie below a scope of their own."""
        count = self._counts[below] = self._counts.get(below, -1) + 1
        if count and count % _SIBLINGS == 0:
            self.place_instances()
            self._groups[below] = self._free(f"{below}/more")
            self.stage.DefinePrim(self._groups[below], "Scope")
        return self._free(f"{self._groups.get(below, below)}/{Tf.MakeValidIdentifier(name)}")

    def _free(self, plain: str) -> str:
        """A path that no prim has yet."""
        path = plain
        while path in self._numbers:
            self._numbers[plain] += 1
            path = f"{plain}_{self._numbers[plain]}"
        self._numbers[path] = 0
        return path

    def once(self, key: Any, kept: object, make: Callable[[], Part]) -> Part:
        """What ``make`` returned for the first call with this key; ``kept`` stays alive, so that its id is its own."""
        if key not in self._made:
            self._made[key] = kept, make()
        return self._made[key][1]

    def place(self, prim: Any, matrix: Matrix) -> None:
        """Places a prim.

        Raises:
            SceneError: the transform is not finite.
        """
        self.finite(matrix, f"others for a transform of {prim.GetPath()}")
        if not np.array_equal(matrix, _UNMOVED):
            UsdGeom.Xformable(prim).AddTransformOp().Set(Gf.Matrix4d(matrix.T.tolist()))

    def instance(self, path: str, prototype: str, matrix: Matrix) -> None:
        """Adds an instance, when :meth:`place_instances` is called."""
        self._waiting.append((path, prototype, matrix))

    def place_instances(self) -> None:
        """Writes the instances that were added, all at once, because the stage is composed again after each change.

        Raises:
            SceneError: a transform is not finite.
        """
        waiting, self._waiting = self._waiting, []
        places = np.array([matrix for *_, matrix in waiting]).reshape(-1, 4, 4)
        self.finite(places, "others for the transforms of instances")
        moved = (places != _UNMOVED).any(axis=(1, 2))
        poses = np.swapaxes(places, 1, 2).tolist()
        layer, kinds = self.stage.GetRootLayer(), Sdf.ValueTypeNames
        with Sdf.ChangeBlock():
            for (path, prototype, _), pose, moves in zip(waiting, poses, moved.tolist(), strict=True):
                prim = Sdf.CreatePrimInLayer(layer, path)
                prim.specifier, prim.typeName, prim.instanceable = Sdf.SpecifierDef, "Xform", True
                prim.referenceList.prependedItems.append(Sdf.Reference("", prototype))
                if moves:
                    move = Sdf.AttributeSpec(prim, "xformOp:transform", kinds.Matrix4d)
                    move.default = Gf.Matrix4d(pose)
                    order = Sdf.AttributeSpec(prim, "xformOpOrder", kinds.TokenArray, Sdf.VariabilityUniform)
                    order.default = Vt.TokenArray(["xformOp:transform"])

    def finite(self, values: Any, what: str) -> None:
        """Checks numbers that are to be written.

        Raises:
            SceneError: one is not finite.
        """
        if not np.isfinite(values).all():
            raise SceneError(f"{self.target}: expected finite numbers, got {what}")

    def vectors(self, values: NDArray[Any], what: str, kind: str = "Vec3fArray") -> Any:
        """Rows of numbers as an array of the library, which has single precision.

        Raises:
            SceneError: one of them is not finite, or beyond single precision.
        """
        with np.errstate(over="ignore"):
            rows = np.ascontiguousarray(values, np.float32)
        self.finite(rows, f"others for {what}")
        return getattr(Vt, kind).FromNumpy(rows)

    def picture(self, texture: ImageTexture, numbers: bool) -> tuple[str, str]:
        """The file of a picture, relative to this one, and its colour space: 8 bits where they hold it, else EXR.

        Args:
            texture: texture, of which the transform is not used.
            numbers: whether its values are numbers rather than colours.
        """
        key = "picture", id(texture.image), numbers
        return self.once(key, texture.image, lambda: self._picture(texture, numbers))

    def _picture(self, texture: ImageTexture, numbers: bool) -> tuple[str, str]:
        path, image = Path(texture.source), texture.image
        space = "raw" if numbers else "sRGB"
        content = None if numbers else as_file(texture)
        if content is not None:
            return self.output.named("textures", path.stem, path.suffix.lower(), [content]), space
        if in_bytes(image, numbers):
            made = io.BytesIO()
            Image.fromarray(number_codes(image) if numbers else srgb_codes(image), "RGB").save(made, "PNG")
            return self.output.named("textures", path.stem or "picture", ".png", [made.getvalue()]), space
        return self.output.picture(image, "", ()), "raw"

    def write(self) -> None:
        """Writes the file; a package (``.usdz``) has its pictures in it.

        Raises:
            SceneError: it cannot be written, or a number is not finite.
        """
        layer, path = self.stage.GetRootLayer(), self.output.path
        for prim in Usd.PrimRange.AllPrims(self.stage.GetPseudoRoot()):
            for one in () if prim.IsInstanceable() else prim.GetAuthoredAttributes():
                value: Any = None if one.GetTypeName().isArray else one.Get()
                if isinstance(value, float | Gf.Vec2f | Gf.Vec3f | Gf.Vec4f):
                    self.finite(np.asarray(value), f"{value} in {one.GetPath()}")
        if path.suffix.lower() == ".usda":
            self.output.text(path.name, layer.ExportToString())
            return
        with TemporaryDirectory() as folder:
            binary = Path(folder) / "scene.usdc"
            try:
                layer.Export(str(binary))
            except Tf.ErrorException as error:
                raise SceneError(f"{self.target}: cannot be written ({error.args[0].commentary})") from None
            self.output.content(path.name, [binary.read_bytes()])


def packed(output: Output, files: list[tuple[str, bytes]]) -> None:
    """Writes a package: files without compression, each aligned, without dates, the scene first."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_STORED) as package:
        for name, part in files:
            entry = zipfile.ZipInfo(name, _FIRST_DATE)
            before = content.tell() + _HEADER + len(name.encode())
            entry.extra = _padding(-before % _ALIGNED)
            package.writestr(entry, part)
    output.content(output.path.name, [content.getvalue()])


def _padding(size: int) -> bytes:
    """An extra field of a header, which has at least four bytes, or none."""
    if size == 0:
        return b""
    size += _ALIGNED if size < 4 else 0
    return b"\x86\x19" + (size - 4).to_bytes(2, "little") + bytes(size - 4)


def sharp(texture: ImageTexture) -> ImageTexture:
    """A picture whose texels are squares, of more texels, for formats that always interpolate."""
    rows, columns = (max(1, _SIDE_SHARP // size) for size in texture.image.shape[:2])
    image = np.ascontiguousarray(np.repeat(np.repeat(texture.image, rows, axis=0), columns, axis=1))
    return ImageTexture(image, texture.uv_scale, texture.uv_offset, texture.wrap, "mipmap")
