"""Frames are batches of framelets, whatever their tiles; blur is as long and as shaped as motion and filter say."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from renderer.frames import TILE_PX, place_tiles, render_image, render_tiles, tile_count, tile_pixels
from renderer.layout.features import Feature
from renderer.sampling.plan import SamplePlan
from renderer.trace import Renderer
from scenes.canonical import Emissive, Instance, PerspectiveCamera, Rectangle, RigidTrack, Scene
from scenes.effects import scenes as effects
from tests.renderer.builders import place
from tsar.types import FrameletBatch

GLOW = Emissive((1.0, 1.0, 1.0))
STILL = [0.0, 0.0, 0.0, 1.0]


@pytest.fixture(scope="module")
def lens():
    """A scene that draws random numbers for its lens, and is moving besides."""
    renderer = Renderer(effects.load("depth-of-field"), specialise=False)
    yield renderer
    renderer.close()


@pytest.fixture(scope="module")
def packets():
    """A scene that packets can trace."""
    renderer = Renderer(effects.load("moving-object"))
    assert renderer.packets
    yield renderer
    renderer.close()


def test_tiles_cover_a_picture_once() -> None:
    assert tile_count(40, 17) == 3 * 2
    columns, rows = tile_pixels(range(6), 40)
    seen = set(zip(columns.ravel().tolist(), rows.ravel().tolist(), strict=True))
    assert len(seen) == 6 * TILE_PX**2
    assert {(c, r) for c in range(40) for r in range(17)} <= seen
    assert (columns[4, :4].tolist(), rows[4, :4].tolist()) == ([16, 17, 16, 17], [16, 16, 17, 17])


@pytest.mark.parametrize("which", ["lens", "packets"])
def test_framelets_and_frames_give_the_same_pixels_for_the_same_samples(which: str, request) -> None:
    renderer = request.getfixturevalue(which)
    plan, size = SamplePlan(8, "poisson", seed=2), (48, 32)
    image = render_image(renderer, plan, *size, 0.0, (0.0, 0.5))
    # the samples of a few pixels, in any order of pixels, as framelets of 8 samples
    pixels = np.array([[5, 3], [40, 30], [17, 16], [0, 0]])
    position, time_s = plan.samples(pixels[:, 0], pixels[:, 1], *size, 0.0, (0.0, 0.5))
    number = torch.zeros(len(pixels), dtype=torch.int64)
    batch = FrameletBatch(number, number, torch.as_tensor(position), torch.as_tensor(time_s))
    color = renderer.trace(batch, size[0] / size[1], 32 * 8**0.5).color
    expected = torch.as_tensor(color.numpy().sum(axis=1, dtype=np.float64) / 8).float()
    assert torch.equal(expected, image[pixels[:, 1], pixels[:, 0]])


@pytest.mark.parametrize("which", ["lens", "packets"])
def test_any_order_of_tiles_gives_the_same_picture(which: str, request) -> None:
    renderer = request.getfixturevalue(which)
    plan, size = SamplePlan(5, "halton"), (70, 41)
    whole = render_image(renderer, plan, *size, 0.0, (0.0, 0.5), frame=3)
    pieces = torch.zeros_like(whole)
    tiles = np.random.default_rng(0).permutation(tile_count(*size)).tolist()
    for some in (tiles[:1], tiles[1:4], tiles[4:]):
        place_tiles(pieces, some, render_tiles(renderer, plan, some, size, 0.0, (0.0, 0.5), frame=3)[0])
    assert torch.equal(whole, pieces)


def test_threads_give_the_same_picture() -> None:
    plan, pictures = SamplePlan(8), []
    for threads in (1, 2, 3):
        renderer = Renderer(effects.load("quad-light"), threads=threads, specialise=False)
        pictures.append(render_image(renderer, plan, 40, 40, 0.0))
        renderer.close()
    assert torch.equal(pictures[0], pictures[1]) and torch.equal(pictures[0], pictures[2])


def test_kernels_for_what_is_needed_give_the_same_picture_as_those_for_everything() -> None:
    for name in ("quad-light", "glass"):
        scene = effects.load(name)
        needed, everything = (Renderer(scene, packets=False, specialise=specialise) for specialise in (True, False))
        assert needed.features < everything.features
        pictures = [render_image(renderer, SamplePlan(4), 48, 36, 0.0) for renderer in (needed, everything)]
        assert torch.equal(*pictures)
        needed.close()
        everything.close()


def slide(velocity: float) -> RigidTrack:
    return RigidTrack(0.0, 1.0, np.array([[0.0, 0.0, 0.0], [velocity, 0.0, 0.0]]), np.array([STILL, STILL]))


def blurred(scene: Scene, plan: SamplePlan) -> np.ndarray:
    """The middle row of a picture over a second."""
    renderer = Renderer(scene, specialise=False)
    row = render_image(renderer, plan, 256, 16, 0.0, (0.0, 1.0))[8, :, 0].double().numpy()
    renderer.close()
    return row


def profile(x: np.ndarray, left: float, velocity: float, kind: str, share: float) -> np.ndarray:
    """How long a half plane whose edge starts at ``left`` covers ``x``: the filter's cumulative distribution."""
    t = np.clip((x - left) / velocity, 0.0, 1.0)
    if kind == "box":
        return np.clip((t - 0.5) / share + 0.5, 0.0, 1.0)
    return np.where(t < 0.5, 2.0 * t**2, 1.0 - 2.0 * (1.0 - t) ** 2)


@pytest.mark.parametrize(("kind", "share"), [("box", 1.0), ("box", 0.5), ("triangle", 1.0)])
@pytest.mark.parametrize("moves", ["object", "camera"])
def test_blur_has_the_length_of_the_motion_and_the_profile_of_the_filter(kind, share: float, moves: str) -> None:
    """A bright half plane at 4 units, its edge from -0.5 to 1 (or the camera the other way)."""
    velocity, left, distance, fov = 1.5, -0.5, 4.0, 10.0
    track = slide(velocity if moves == "object" else -velocity)
    matrix = place((left - 20.0, 0.0, -distance), scale=(20.0, 20.0, 1.0))
    camera = PerspectiveCamera(fov_deg=fov, track=track if moves == "camera" else None)
    plate = Instance(Rectangle(), GLOW, matrix, track if moves == "object" else None)
    plan = SamplePlan(512, "hammersley", time_filter=kind, box_share=share)
    seen = 1.0 - blurred(Scene(camera, (plate,)), plan)
    half = distance * np.tan(np.radians(fov / 2.0)) * 16.0  # the shorter side is 16 of 256 pixels
    x = (2.0 * (np.arange(256) + 0.5) / 256 - 1.0) * half
    expected = profile(x, left, velocity, kind, share)
    np.testing.assert_allclose(seen, expected, atol=0.03)
    length = np.ptp(x[(seen > 0.001) & (seen < 0.999)])
    assert length == pytest.approx(velocity * share, abs=(3.0 if kind == "triangle" else 2.0) * (x[1] - x[0]))


def test_what_moves_needs_poses_and_what_rests_does_not() -> None:
    assert Renderer(effects.load("moving-object")).features & Feature.MOTION
    for name in ("plain", "depth-of-field"):
        assert not Renderer(effects.load(name), packets=False).features & Feature.MOTION
