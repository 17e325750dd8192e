"""The host side of the renderer: framelet batches and whole frames, by the same kernel."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Literal

import numpy as np
import torch
import warp as wp
from torch import Tensor

from renderer.batches import PacketBatches, checked, empty_hits
from renderer.compute import device as devices
from renderer.compute.launching import shared
from renderer.grids import grid_frame
from renderer.kernels import entry as kernels
from renderer.kernels import packets as packet_kernels
from renderer.kernels.bundles import stack_size
from renderer.layout.features import ALL, PACKETS, RANDOM, Feature
from renderer.layout.sizes import BLOCK_PX
from renderer.layout.structs import Ray, SceneData, ViewData
from renderer.singles import SingleSamples
from renderer.tables.accelerators import STRUCTURES, Structure
from renderer.tables.buffers import build_buffers
from renderer.tables.checks import check_frame_size
from renderer.tables.origin import Vector, near_origin
from renderer.tables.requirements import lit_by_all, required
from renderer.tables.viewing import camera_view, check_camera
from renderer.viewpoints import viewpoint_of
from scenes.canonical import Scene
from tsar.types import FrameletBatch, Hits, SampleBatch, Viewpoint

_RANGE = 1024  # samples or pixels per launch without packets: few enough that threads finish together
_RANGE_CUDA = 1 << 18  # few enough that the stacks of waiting rays fit into memory
_SECONDARY = "shadow_rays", "reflection_rays", "refraction_rays"


class Renderer:
    """A scene ready for rendering.

    Attributes:
        device: where kernels run, ``cpu`` or ``cuda:0``.
        threads: number of host threads that launch kernels (``cpu`` only).
        footprint_resolution_px: number of pixels along the shorter image axis for which :meth:`trace` filters textures.
        features: features for which kernels are compiled.
        packets: whether sixteen samples are traced at a time.
        random: whether samples draw random numbers: for a lens, extended lights, glossy rays or paths.
        scene, buffers: scene that is traced, moved near the origin, and its tables on the device.
    """

    def __init__(
        self,
        scene: Scene,
        device: str = "cpu",
        threads: int | None = None,
        footprint_resolution_px: float = 512.0,
        throughput_cutoff: float = 2.0e-3,
        packets: bool = True,
        specialise: bool = True,
        seed: int = 0,
        structure: Structure | Literal["warp"] = "bvh",
        count_work: bool = False,
        origin: Vector | None = None,
    ) -> None:
        """Builds acceleration structures and loads kernels.

        Args:
            scene: scene to render.
            device: ``cpu`` or ``cuda:0``.
            threads: number of host threads, by default one per core that this process may use.
            footprint_resolution_px: see the class; the same for all batches, so that all tiles are equally sharp.
            throughput_cutoff: least throughput of a secondary ray; a chain of mirrors ends below it.
            packets: trace sixteen samples at a time if packets support all features of the scene (``cpu`` only);
                otherwise one by one, as on other devices. Pictures differ by rounding.
            specialise: compile kernels for the features of the scene; otherwise for all features. Pictures are the
                same.
            structure: structure over the triangles of meshes: the tree of boxes (``bvh``), a kd-tree, ``brute`` for
                none, or ``warp`` for Warp's own tree, which a GPU always uses. Packets support only the first. The
                first three give the same bits, ``warp`` the same up to rounding.
            count_work: count visited nodes and tested triangles, as ``node_visits`` and ``triangle_tests``; for single
                samples on the CPU with the first three structures.
            seed: seed of the random numbers for lens, extended lights and glossy rays, 0 to 2^32 - 1.
            origin: origin of the space in which rays are traced, scene units; by default one near the camera.

        Raises:
            SceneError: if the scene contains an unsupported part.
            DeviceError: if the device does not exist.
        """
        if threads is not None and threads < 1:
            raise ValueError(f"threads: expected at least 1, got {threads}")
        if not footprint_resolution_px > 0.0:
            raise ValueError(f"footprint_resolution_px: expected a positive number, got {footprint_resolution_px}")
        if not 0.0 <= throughput_cutoff < math.inf:
            raise ValueError(f"throughput_cutoff: expected a share of at least 0, got {throughput_cutoff}")
        if not 0 <= seed < 1 << 32:
            raise ValueError(f"seed: expected 0 to 2^32 - 1, got {seed}")
        self.device = devices.pick(device)
        self.threads = threads or devices.core_count()
        self.footprint_resolution_px = float(footprint_resolution_px)
        check_camera(scene)
        self.scene = scene = near_origin(lit_by_all(scene), origin)
        self._camera = check_camera(scene)
        needed = required(scene)
        if structure not in (*STRUCTURES, "warp"):
            raise ValueError(f"structure: expected one of {', '.join(STRUCTURES)}, warp, got {structure!r}")
        own = None if structure == "warp" or self.device != "cpu" else structure
        if count_work and own is None:
            raise ValueError(f"count_work: expected a structure of the CPU's, got {structure!r} on {self.device}")
        together = packets and self.device == "cpu" and structure == "bvh" and not count_work
        self.packets = together and packet_kernels.suffice_for(needed)
        if own is None:
            needed |= Feature.WARP_TREES
        self.features = (
            PACKETS if self.packets else kernels.nearest(needed) if specialise else ALL | needed & Feature.PATHS
        )
        self._kernels = packet_kernels if self.packets else kernels.specialised(self.features)
        # before the buffers are built, which takes those of packets too: they are compiled side by side
        devices.load_kernels([packet_kernels, kernels] if self.packets else kernels, self.device)
        self.buffers = build_buffers(scene, self.device, own)
        if not self.packets:  # these are compiled for the scene, now that it is known to be supported
            devices.load_kernels(self._kernels.module, self.device)
        data = self.buffers.data
        self.random = bool(needed & RANDOM)
        data.throughput_cutoff, data.seed = float(throughput_cutoff), wp.uint32(seed)
        self._work = np.zeros(2, np.int64) if count_work else None
        self._stack_size = stack_size(self.features, data.depth, data.reflection_rays, data.refraction_rays)
        self._pool = ThreadPoolExecutor(self.threads) if self.threads > 1 and self.device == "cpu" else None
        self._batches: dict[tuple[float, float], PacketBatches] = {}
        if self.packets:
            self._packet_batches(1.0, self.footprint_resolution_px)

    def trace(self, batch: FrameletBatch, aspect: float = 1.0, footprint_px: float | None = None) -> SampleBatch:
        """Shades the samples of a batch; those of one row are a group, over which secondary rays are stratified.

        Args:
            batch: positions ``(n, samples, 2)``, and times ``(n, samples)`` or one for all; whether first hits are
                requested, and factors of the samples' footprints.
            aspect: width over height of the image.
            footprint_px: number of pixels along its shorter axis for which textures are filtered, by default
                ``footprint_resolution_px``.

        Returns:
            Linear radiance ``(n, samples, 3)`` float32 on the device of the batch, ray counts, and hits if requested.
            Hits do not change the bits of colours.

        Raises:
            ValueError: if shapes do not match, times are not float64 or not finite, or a footprint is not finite and
                above 0.
        """
        batch = checked(batch)
        if not 0.0 < aspect < math.inf:
            raise ValueError(f"aspect: expected a positive number, got {aspect}")
        return self._shade(batch, aspect, footprint_px or self.footprint_resolution_px)

    def change_texels(self, change: Callable[[Tensor], Tensor]) -> None:
        """Replaces the colours of all textures, at every level, ``(texels, 3)`` float32."""
        texels = wp.to_torch(self.buffers.data.texels)
        texels.copy_(change(texels))

    def viewpoint(self, time_s: float, aspect: float = 1.0) -> Viewpoint:
        """Poses of the camera and all instances, with the same bits as for samples of that time.

        A scene far from the origin is moved near it before it is traced. Hits, and the world of this record, are in the
        space of the moved scene.

        Args:
            time_s: animation time, seconds.
            aspect: width over height of the image.

        Raises:
            ValueError: if the time is not finite.
        """
        if not math.isfinite(time_s):
            raise ValueError(f"time_s: expected a finite time, got {time_s}")
        _, view = self.posed(float(time_s), aspect, self.footprint_resolution_px)
        return viewpoint_of(self.buffers, view, float(time_s))

    def render_frame(self, time_s: float, width_px: int, height_px: int, samples_per_axis: int = 1) -> Tensor:
        """Renders a whole picture.

        Args:
            time_s: animation time, seconds.
            width_px, height_px: size of the picture; the field of view spans its shorter axis.
            samples_per_axis: side of the regular grid of samples that is averaged in each pixel.

        Returns:
            ``(height, width, 3)`` float32 linear RGB on the CPU, row 0 at the top.

        Raises:
            ValueError: if a size is below 1 or beyond its limit, or the picture does not fit into memory.
        """
        for name, value in (("width_px", width_px), ("height_px", height_px), ("samples_per_axis", samples_per_axis)):
            if int(value) != value or value < 1:
                raise ValueError(f"{name}: expected a whole number of at least 1, got {value}")
        check_frame_size(width_px, height_px, samples_per_axis)
        if self._kernels.render_pixels is None:
            return grid_frame(self, float(time_s), width_px, height_px, samples_per_axis)
        target = torch.device(self.device)
        image = torch.empty(height_px, width_px, 3, device=target)
        _, view = self.posed(float(time_s), width_px / height_px, min(width_px, height_px) * samples_per_axis)
        shared = samples_per_axis, wp.float64(time_s), wp.from_torch(image, dtype=wp.vec3)
        pixels = -(-width_px // BLOCK_PX) * -(-height_px // BLOCK_PX) * BLOCK_PX**2
        self._launch(self._kernels.render_pixels, view, shared, pixels)
        return image.cpu()

    def posed(self, time_s: float, aspect: float, footprint_px: float) -> tuple[SceneData, ViewData]:
        """The scene, and the camera at one time, for launches of other kernels."""
        view = self._view(aspect, footprint_px)
        self._pose(view, time_s)
        return self.buffers.data, view

    @property
    def shutter_s(self) -> tuple[float, float]:
        """Opening and closing time of the scene's shutter, relative to a frame's time, seconds."""
        opening, closing = getattr(self._camera, "shutter_s", (0.0, 0.0))
        return float(opening), float(closing)

    def close(self) -> None:
        """Stops the worker threads; the renderer must not be used afterwards."""
        if self._pool is not None:
            self._pool.shutdown()

    def _shade(self, batch: FrameletBatch, aspect: float, footprint_px: float) -> SampleBatch:
        """Colours, ray counts, and hits if requested, of a batch from :func:`renderer.batches.checked`."""
        groups, group_size, _ = batch.position.shape
        count, home = groups * group_size, batch.position.device
        if count == 0:
            color, totals = torch.zeros(groups, group_size, 3, device=home), [0, 0]
            hits = empty_hits(groups, group_size, home) if batch.hits else None
        elif self.packets:
            color, totals, hits = self._packet_batches(aspect, footprint_px).shade(batch)
        else:
            view, time_s = self._view(aspect, footprint_px), batch.time_s
            if not isinstance(time_s, Tensor):
                self._pose(view, time_s)
            inputs = SingleSamples(batch, torch.device(self.device))
            self._launch(self._kernels.shade_samples, view, inputs.arguments, count)
            color, totals, hits = inputs.color, inputs.totals(), inputs.hits
        kinds = _SECONDARY if Feature.GLASS in self.features and count else _SECONDARY[:2]
        counters = {"primary_rays": count, **dict(zip(kinds, totals, strict=False))}
        if self._work is not None:
            counters |= dict(zip(("node_visits", "triangle_tests"), self._work.tolist(), strict=True))
            self._work[:] = 0
        if hits is not None:
            hits = Hits(hits.instance.to(home), hits.point.to(home), hits.occluder.to(home))
        return SampleBatch(color if color.device == home else color.to(home), counters, hits)

    def _packet_batches(self, aspect: float, footprint_px: float) -> PacketBatches:
        """Recorded launches for pictures of one aspect and footprint."""
        key = aspect, footprint_px
        if key not in self._batches:
            still, moving = (self._view(*key) for _ in range(2))
            self._batches[key] = PacketBatches(self.buffers, still, moving, self.threads)
        return self._batches[key]

    def _launch(self, kernel: wp.Kernel, view: ViewData, shared: tuple[object, ...], count: int) -> None:
        """Runs a kernel over ``count`` elements: one launch on a GPU, one per host thread on the CPU.

        Launches on the CPU release the global interpreter lock. Those of packets take work from a shared counter;
        single samples are distributed in ranges.
        """
        if self.packets:
            taken = wp.zeros(1, dtype=wp.int32, device="cpu")
            inputs = [self.buffers.data, view, taken, *shared]
            command = wp.launch(kernel, dim=1, inputs=inputs, device="cpu", record_cmd=True)
            list((map if self._pool is None else self._pool.map)(lambda _: command.launch(), range(self.threads)))
            return

        def run(first: int, dim: int) -> None:
            stack = wp.empty((dim if self._stack_size > 1 else 1, self._stack_size), Ray, self.device)
            wp.launch(kernel, dim=dim, inputs=[self.buffers.data, view, stack, first, *shared], device=self.device)

        if self.device != "cpu":
            torch.cuda.synchronize()  # Warp launches on its own stream
            for first in range(0, count, _RANGE_CUDA):
                run(first, min(_RANGE_CUDA, count - first))
            wp.synchronize_device(self.device)
            return
        firsts = range(0, count, _RANGE)
        for _ in (map if self._pool is None else self._pool.map)(lambda i: run(i, min(_RANGE, count - i)), firsts):
            pass

    def _view(self, aspect: float, footprint_px: float) -> ViewData:
        view = camera_view(self._camera, self.buffers.tracks, aspect, footprint_px)
        if self._work is not None:
            view.work = shared(self._work, wp.int64)
        return view

    def _pose(self, view: ViewData, time_s: float) -> None:
        """Adds the poses of all tracks at the common time of all samples."""
        count = len(self.buffers.tracks.tracks)
        poses = wp.empty(count, wp.vec3, self.device), wp.empty(count, wp.quat, self.device)
        inputs = [self.buffers.data, view, *poses, wp.float64(time_s)]
        wp.launch(kernels.pose_tracks, dim=count, inputs=inputs, device=self.device)
        view.pose_translation, view.pose_rotation = poses
        view.single_time = 1
