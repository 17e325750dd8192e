"""Embree as a peer on one thread: through its C interface in all its modes, and through embreex.

A mode is the number of rays a call and whether Embree is told that they are coherent. The loop over the calls is C,
which the system's compiler builds for the instruction set that is measured; Embree is the library in embreex' wheel.
"""

from __future__ import annotations

import ctypes
import importlib.util
import shutil
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.bench.native_code import compiled

Points = NDArray[np.float32]

_LOOPS = Path(__file__).parent / "native" / "embree_loops.c"
_HIGH_QUALITY = 2  # RTC_BUILD_QUALITY_HIGH: with spatial splits
_ALL_FEATURES = 0xFFFFFFFF  # RTC_FEATURE_FLAG_ALL
_COHERENT = 1 << 16  # RTC_RAY_QUERY_FLAG_COHERENT
_TRIANGLES, _INDEX, _VERTEX, _UINT3, _FLOAT3 = 0, 0, 1, 0x5003, 0x9003


class EmbreexMesh:
    """A mesh in Embree's tree through embreex, a call a ray; the tree is built at the first query.

    Embree traces without its robust mode, and for closest hits returns the face alone: this is embreex' fastest way.
    """

    def __init__(self, vertices: Points, faces: NDArray[np.int32]) -> None:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        self._scene: Any = EmbreeScene()
        self._mesh = TriangleMesh(self._scene, vertices, faces)

    def closest(self, origin: Points, direction: Points) -> NDArray[np.int32]:
        """Face that each ray ``(n, 3)`` hits first, -1 for none."""
        return self._scene.run(origin, direction)

    def blocked(self, origin: Points, direction: Points, t_max: Points) -> NDArray[np.int32]:
        """0 where a ray hits something nearer than ``t_max``, -1 elsewhere; lengths are in units of the direction."""
        return self._scene.run(origin, direction, dists=t_max, query="OCCLUDED")

    def hits(self, origin: Points, direction: Points) -> tuple[NDArray[np.int32], Points]:
        """Faces as in :meth:`closest` and their distances in units of the direction's length; not timed."""
        found = self._scene.run(origin, direction, output=True)
        return found["primID"], found["tfar"]


class _Arguments(ctypes.Structure):
    """``RTCIntersectArguments`` and ``RTCOccludedArguments`` of Embree 4."""

    _fields_ = (
        ("flags", ctypes.c_uint),
        ("features", ctypes.c_uint),
        ("context", ctypes.c_void_p),
        ("filter", ctypes.c_void_p),
        ("geometry", ctypes.c_void_p),
        ("width", ctypes.c_float),
    )


@dataclass(frozen=True)
class Mode:
    """One way to ask Embree.

    Attributes:
        lanes: number of rays a call: 1, 8 or 16.
        coherent: whether Embree is told that the rays of a call are coherent; it changes the traversal of packets.
    """

    lanes: int
    coherent: bool = False

    @property
    def name(self) -> str:
        """The mode in words."""
        return f"Embree {self.lanes}{' coherent' if self.coherent else ''}"


MODES = (Mode(1), Mode(8), Mode(8, coherent=True), Mode(16), Mode(16, coherent=True))
"""All modes of Embree that are measured."""


class EmbreeMesh:
    """A mesh in Embree's tree of the highest quality, asked in any mode on one thread, without its robust mode."""

    def __init__(self, vertices: Points, faces: NDArray[np.int32], isa: str = "native") -> None:
        """Builds the tree.

        Args:
            vertices: ``(v, 3)``.
            faces: ``(f, 3)`` indices of corners.
            isa: instruction set that Embree and the loop may use: ``native``, ``avx2`` or ``avx512``.

        Raises:
            RuntimeError: Embree reports an error.
        """
        lib, self._isa = _library(), isa
        # the tree refers to their memory
        self._vertices, self._faces = np.ascontiguousarray(vertices, np.float32), np.ascontiguousarray(faces, np.int32)
        limit = "" if isa == "native" else f",isa={isa}"
        device = lib.rtcNewDevice(f"threads=1{limit}".encode())
        self._scene, mesh = lib.rtcNewScene(device), lib.rtcNewGeometry(device, _TRIANGLES)
        lib.rtcSetSceneBuildQuality(self._scene, _HIGH_QUALITY)
        lib.rtcSetGeometryBuildQuality(mesh, _HIGH_QUALITY)
        for kind, form, array in ((_INDEX, _UINT3, self._faces), (_VERTEX, _FLOAT3, self._vertices)):
            lib.rtcSetSharedGeometryBuffer(mesh, kind, 0, form, array.ctypes.data, 0, 12, len(array))
        lib.rtcCommitGeometry(mesh)
        lib.rtcAttachGeometry(self._scene, mesh)
        lib.rtcReleaseGeometry(mesh)
        lib.rtcCommitScene(self._scene)
        fault = lib.rtcGetDeviceError(device)
        lib.rtcReleaseDevice(device)  # the scene holds it
        if fault:
            raise RuntimeError(f"Embree: error {fault} while the tree was built")

    def closest(self, mode: Mode, origin: Points, direction: Points) -> tuple[NDArray[np.int32], Points]:
        """Face that each ray ``(n, 3)`` hits first, -1 for none, and its distance in units of the direction's
        length."""
        return self._ask("Intersect", mode, origin, direction, None)

    def blocked(self, mode: Mode, origin: Points, direction: Points, t_max: Points) -> NDArray[np.int32]:
        """0 where a ray hits something nearer than ``t_max``, -1 elsewhere; lengths are in units of the direction."""
        return self._ask("Occluded", mode, origin, direction, t_max)[0]

    def _ask(
        self, query: str, mode: Mode, origin: Points, direction: Points, t_max: Points | None
    ) -> tuple[NDArray[np.int32], Points]:
        count = len(origin)
        face, distance = np.empty(count, np.int32), np.empty(count, np.float32)
        arguments = _Arguments(_COHERENT if mode.coherent else 0, _ALL_FEATURES)
        function = ctypes.cast(getattr(_library(), f"rtc{query}{mode.lanes}"), ctypes.c_void_p)
        _loops(self._isa).ask_embree(
            mode.lanes, function, self._scene, ctypes.byref(arguments), count, _address(origin), _address(direction),
            None if t_max is None else _address(t_max), face.ctypes.data, distance.ctypes.data,
        )  # fmt: skip
        return face, distance

    def __del__(self) -> None:
        if hasattr(self, "_scene"):
            _library().rtcReleaseScene(self._scene)


def missing() -> str:
    """What is missing to ask Embree through its C interface; empty if nothing is."""
    if importlib.util.find_spec("embreex") is None:
        return "embreex is not installed"
    if not _libraries():
        return "embreex brings no library of Embree 4"
    return "" if shutil.which("cc") else "there is no C compiler, cc"


def _address(values: Points) -> int:
    if values.dtype != np.float32 or not values.flags.c_contiguous:
        raise ValueError(f"expected contiguous float32 values, got {values.dtype}")
    return values.ctypes.data


def _libraries() -> list[Path]:
    found = importlib.util.find_spec("embreex")
    return (
        sorted((Path(found.origin).parents[1] / "embreex.libs").glob("libembree4*")) if found and found.origin else []
    )


@cache
def _library() -> ctypes.CDLL:
    """Embree's library, with the types of the functions that are used."""
    import embreex.rtcore_scene  # noqa: F401  # loads the libraries on which it depends

    lib, pointer, number, size = ctypes.CDLL(str(_libraries()[0])), ctypes.c_void_p, ctypes.c_uint, ctypes.c_size_t
    for name, answer, *arguments in (
        ("rtcNewDevice", pointer, ctypes.c_char_p),
        ("rtcGetDeviceError", ctypes.c_int, pointer),
        ("rtcReleaseDevice", None, pointer),
        ("rtcNewScene", pointer, pointer),
        ("rtcSetSceneBuildQuality", None, pointer, ctypes.c_int),
        ("rtcCommitScene", None, pointer),
        ("rtcReleaseScene", None, pointer),
        ("rtcNewGeometry", pointer, pointer, ctypes.c_int),
        ("rtcSetGeometryBuildQuality", None, pointer, ctypes.c_int),
        ("rtcSetSharedGeometryBuffer", None, pointer, ctypes.c_int, number, ctypes.c_int, pointer, size, size, size),
        ("rtcCommitGeometry", None, pointer),
        ("rtcAttachGeometry", number, pointer, pointer),
        ("rtcReleaseGeometry", None, pointer),
    ):
        function = getattr(lib, name)
        function.restype, function.argtypes = answer, arguments
    return lib


@cache
def _loops(isa: str) -> ctypes.CDLL:
    """The loops over the calls, compiled for an instruction set."""
    lib, pointer = compiled(_LOOPS, isa), ctypes.c_void_p
    lib.ask_embree.restype = None
    lib.ask_embree.argtypes = (ctypes.c_int, pointer, pointer, pointer, ctypes.c_long, *[pointer] * 5)
    return lib
