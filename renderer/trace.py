"""The host side of the renderer: framelet batches and whole frames through one kernel."""

from __future__ import annotations

import math
import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import torch
import warp as wp
from torch import Tensor

from renderer import device as devices
from renderer import kernels
from renderer import packets as packet_kernels
from renderer.batches import PacketBatches
from renderer.buffers import build_buffers
from renderer.checks import check_affine
from renderer.structs import ViewData
from scenes.canonical import PerspectiveCamera, Scene, SceneError
from tsar.types import FrameletBatch, SampleBatch

_RANGE = 1024  # samples or pixels per launch without packets: few enough that threads end together
_BLOCK_PX = 16  # as the kernels' order of pixels
_BYTES_PER_PIXEL = 12
_SAMPLES_PER_PIXEL_AXIS_MAX = 1024
_SAMPLES_PER_AXIS_MAX = 1 << 22  # float32 tells two of so many apart


class Renderer:
    """A scene ready to be sampled.

    Attributes:
        device: where kernels run, ``cpu`` or ``cuda:0``.
        threads: host threads that launch kernels (``cpu`` only).
        footprint_resolution_px: pixels along the shorter image axis that :meth:`trace` filters textures for.
    """

    def __init__(
        self,
        scene: Scene,
        device: str = "cpu",
        threads: int | None = None,
        footprint_resolution_px: float = 512.0,
        throughput_cutoff: float = 2.0e-3,
        packets: bool = True,
    ) -> None:
        """Builds acceleration structures and loads kernels.

        Args:
            scene: what to render.
            device: ``cpu`` or ``cuda:0``.
            threads: host threads, by default one per core this process may use.
            footprint_resolution_px: see the class. It is fixed for all batches, so that a coarse tile is as sharp as a
                fine one, and a framed renderer as sharp as an adaptive one.
            throughput_cutoff: a chain of mirrors ends where it would contribute less than this share.
            packets: trace sixteen samples at a time (``cpu`` only); without, one by one as other devices do. Pictures
                differ by rounding.

        Raises:
            SceneError: if the scene holds what the renderer does not support.
            DeviceError: if the device is not there.
        """
        if threads is not None and threads < 1:
            raise ValueError(f"threads: expected at least 1, got {threads}")
        if not footprint_resolution_px > 0.0:
            raise ValueError(f"footprint_resolution_px: expected a positive number, got {footprint_resolution_px}")
        if not 0.0 <= throughput_cutoff < math.inf:
            raise ValueError(f"throughput_cutoff: expected a share of at least 0, got {throughput_cutoff}")
        self.device = devices.pick(device)
        self.threads = threads or devices.core_count()
        self.footprint_resolution_px = float(footprint_resolution_px)
        self._camera = _check_camera(scene)
        self._scene = scene
        self._kernels = packet_kernels if packets and self.device == "cpu" else kernels
        # before the buffers are built, which takes kernels too: all are compiled side by side
        devices.load_kernels([kernels, self._kernels], self.device)
        self._buffers = build_buffers(scene, self.device, self._kernels is packet_kernels)
        self._buffers.data.throughput_cutoff = float(throughput_cutoff)
        self._pool = ThreadPoolExecutor(self.threads) if self.threads > 1 and self.device == "cpu" else None
        self._batches = None
        if self._kernels is packet_kernels:
            still, moving = (self._view(1.0, self.footprint_resolution_px) for _ in range(2))
            self._batches = PacketBatches(self._buffers, still, moving, self.threads, self._pool)

    def trace(self, batch: FrameletBatch) -> SampleBatch:
        """Shades the samples of a batch on a square image.

        Args:
            batch: positions ``(n, samples, 2)`` and times ``(n, samples)``.

        Returns:
            Linear radiance ``(n, samples, 3)`` float32 on the device of the batch, and ray counts.

        Raises:
            ValueError: if the shapes do not fit or a time is not finite.
        """
        shape = tuple(batch.position.shape)
        if len(shape) != 3 or shape[2] != 2 or tuple(batch.time_s.shape) != shape[:2]:
            raise ValueError(
                f"FrameletBatch: expected position (n, s, 2) and time_s (n, s), got {shape} and "
                f"{tuple(batch.time_s.shape)}"
            )
        color, counters = self._shade(batch.position.reshape(-1, 2), batch.time_s.reshape(-1))
        return SampleBatch(color.reshape(*shape[:2], 3), counters)

    def render_frame(self, time_s: float, width_px: int, height_px: int, samples_per_axis: int = 1) -> Tensor:
        """Renders a whole picture: a batch of framelets of all its pixels.

        Args:
            time_s: animation time, seconds.
            width_px, height_px: size of the picture; the field of view spans its shorter axis.
            samples_per_axis: a regular grid of this many samples squared is averaged per pixel.

        Returns:
            ``(height, width, 3)`` float32 linear RGB on the CPU, row 0 at the top.

        Raises:
            ValueError: if a size is below 1 or beyond its limit, or the picture does not fit into memory.
        """
        for name, value in (("width_px", width_px), ("height_px", height_px), ("samples_per_axis", samples_per_axis)):
            if int(value) != value or value < 1:
                raise ValueError(f"{name}: expected a whole number of at least 1, got {value}")
        _check_size(width_px, height_px, samples_per_axis)
        target = torch.device(self.device)
        image = torch.empty(height_px, width_px, 3, device=target)
        view = self._view(width_px / height_px, min(width_px, height_px) * samples_per_axis)
        self._pose(view, float(time_s))
        shared = samples_per_axis, wp.float64(time_s), wp.from_torch(image, dtype=wp.vec3)
        pixels = -(-width_px // _BLOCK_PX) * -(-height_px // _BLOCK_PX) * _BLOCK_PX**2
        self._launch(self._kernels.render_pixels, view, shared, pixels)
        return image.cpu()

    def close(self) -> None:
        """Ends the worker threads; the renderer must not be used afterwards."""
        if self._pool is not None:
            self._pool.shutdown()

    def _shade(self, position: Tensor, time_s: Tensor) -> tuple[Tensor, dict[str, int]]:
        """Colours ``(k, 3)`` and ray counts of flat lists of samples."""
        count, home = position.shape[0], position.device
        if count == 0:
            return torch.zeros(0, 3, device=home), {"primary_rays": 0, "shadow_rays": 0, "reflection_rays": 0}
        target = torch.device(self.device)
        position = position.to(target, torch.float32).contiguous()
        earliest, latest = _bounds(time_s)
        if not (math.isfinite(earliest) and math.isfinite(latest)):
            raise ValueError("time_s: expected finite times")
        single_time_s = earliest if earliest == latest else None
        if self._batches is not None:
            color, shadow, reflection = self._batches.shade(position, time_s, single_time_s)
            return color.to(home), {"primary_rays": count, "shadow_rays": shadow, "reflection_rays": reflection}
        color = torch.empty(count, 3, device=target)
        rays = torch.empty(count, 2, dtype=torch.int32, device=target)
        view = self._view(1.0, self.footprint_resolution_px)
        if single_time_s is not None:
            self._pose(view, single_time_s)
        shared = (
            wp.from_torch(position, dtype=wp.vec2),
            wp.from_torch(time_s.to(target, torch.float64).contiguous(), dtype=wp.float64),
            wp.from_torch(color, dtype=wp.vec3),
            wp.from_torch(rays, dtype=wp.vec2i),
        )
        self._launch(self._kernels.shade_samples, view, shared, count)
        shadow, reflection = _totals(rays)
        return color.to(home), {"primary_rays": count, "shadow_rays": shadow, "reflection_rays": reflection}

    def _launch(self, kernel: wp.Kernel, view: ViewData, shared: tuple[object, ...], count: int) -> None:
        """Runs a kernel over ``count`` elements: one launch on a GPU, one a host thread on the CPU.

        Launches on the CPU release the interpreter lock. Those of packets take what is left to do from one counter;
        single samples are dealt out in ranges.
        """
        if self._kernels is packet_kernels:
            taken = wp.zeros(1, dtype=wp.int32, device="cpu")
            inputs = [self._buffers.data, view, taken, *shared]
            command = wp.launch(kernel, dim=1, inputs=inputs, device="cpu", record_cmd=True)
            others = [self._pool.submit(command.launch) for _ in range(self.threads - 1)] if self._pool else []
            command.launch()
            for other in others:
                other.result()
            return

        def run(first: int, dim: int) -> None:
            wp.launch(kernel, dim=dim, inputs=[self._buffers.data, view, first, *shared], device=self.device)

        if self.device != "cpu":
            torch.cuda.synchronize()  # Warp launches on a stream of its own
            run(0, count)
            wp.synchronize_device(self.device)
            return
        firsts = range(0, count, _RANGE)
        for _ in (map if self._pool is None else self._pool.map)(lambda i: run(i, min(_RANGE, count - i)), firsts):
            pass

    def _view(self, aspect: float, footprint_px: float) -> ViewData:
        """Camera record for samples of many times; ``aspect`` is width over height."""
        tangent = math.tan(math.radians(self._camera.fov_deg) / 2.0)
        to_world = np.asarray(self._camera.to_world, np.float64)
        view = ViewData()
        view.from_camera = wp.mat33(*to_world[:3, :3].astype(np.float32).reshape(-1).tolist())
        view.from_camera_offset = wp.vec3(*to_world[:3, 3].tolist())
        view.camera_track = self._buffers.tracks.add(self._camera.track)
        view.tan_x, view.tan_y = tangent * max(aspect, 1.0), tangent * max(1.0 / aspect, 1.0)
        view.spread = 2.0 * tangent / footprint_px
        return view

    def _pose(self, view: ViewData, time_s: float) -> None:
        """Adds the poses of all tracks at the one time of all samples."""
        count = len(self._buffers.tracks.tracks)
        poses = wp.empty(count, wp.vec3, self.device), wp.empty(count, wp.quat, self.device)
        inputs = [self._buffers.data, view, *poses, wp.float64(time_s)]
        wp.launch(kernels.pose_tracks, dim=count, inputs=inputs, device=self.device)
        view.pose_translation, view.pose_rotation = poses
        view.single_time = 1


def _check_size(width_px: int, height_px: int, samples_per_axis: int) -> None:
    if samples_per_axis > _SAMPLES_PER_PIXEL_AXIS_MAX:
        raise ValueError(f"samples_per_axis: expected at most {_SAMPLES_PER_PIXEL_AXIS_MAX}, got {samples_per_axis}")
    if max(width_px, height_px) * samples_per_axis > _SAMPLES_PER_AXIS_MAX:
        raise ValueError(
            f"render_frame: expected at most {_SAMPLES_PER_AXIS_MAX:,} samples along an axis, got "
            f"{max(width_px, height_px)} pixels of {samples_per_axis}"
        )
    need, have = width_px * height_px * _BYTES_PER_PIXEL, _free_memory_bytes()
    if need > have:
        raise ValueError(
            f"render_frame: {width_px} x {height_px} pixels need about {need / 2**30:.1f} GiB of memory, "
            f"{have / 2**30:.1f} GiB are free"
        )


# On the host by NumPy: a parallel reduction by torch leaves its threads spinning for milliseconds beside ours.


def _bounds(time_s: Tensor) -> tuple[float, float]:
    values = time_s.numpy() if time_s.device.type == "cpu" else time_s
    return float(values.min()), float(values.max())


def _totals(rays: Tensor) -> list[int]:
    if rays.device.type == "cpu":
        return rays.numpy().sum(axis=0, dtype=np.int64).tolist()
    return rays.sum(dim=0, dtype=torch.int64).tolist()


def _free_memory_bytes() -> int:
    try:
        with open("/proc/meminfo") as lines:
            for line in lines:
                if line.startswith("MemAvailable:"):
                    return int(line.split()[1]) * 1024
    except OSError:
        pass
    return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")


def _check_camera(scene: Scene) -> PerspectiveCamera:
    camera = scene.camera
    if not isinstance(camera, PerspectiveCamera):
        raise SceneError(f"camera {type(camera).__name__} is not supported yet, expected PerspectiveCamera")
    if camera.lens_radius > 0.0:
        raise SceneError(f"PerspectiveCamera.lens_radius {camera.lens_radius} is not supported yet, expected 0")
    if tuple(camera.shutter_s) != (0.0, 0.0):
        raise SceneError(f"PerspectiveCamera.shutter_s {camera.shutter_s} is not supported yet, expected (0, 0)")
    check_affine(camera.to_world, "PerspectiveCamera.to_world")
    return camera
