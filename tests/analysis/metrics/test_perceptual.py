"""Perceptual scores: no difference has the best one, more noise a worse one, whatever the number of threads."""

from __future__ import annotations

import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import torch

from analysis.metrics.display_model import DisplayModel
from analysis.metrics.perceptual import Frames, flip, jod, ssim
from tsar.config import ConfigError

ROOT = Path(__file__).resolve().parents[3]
AT_60, AT_120 = DisplayModel(), DisplayModel(rate_hz=120.0)
NOISE = np.random.default_rng(1).standard_normal((6, 64, 64, 3))


def still() -> Frames:
    """Six times the same picture with detail of several scales."""
    y, x = np.mgrid[:64, :64] / 64.0
    plane = 128 + 40 * np.sin(20 * x) * np.sin(9 * y) + np.random.default_rng(0).uniform(-20, 20, (64, 64))
    return np.broadcast_to(plane.astype(np.uint8)[None, :, :, None], (6, 64, 64, 3)).copy()


def noisy(amount: float) -> Frames:
    return np.clip(still() + amount * NOISE, 0, 255).astype(np.uint8)


def encoded(frames: Frames) -> torch.Tensor:
    """The first of the images in [0, 1]."""
    return torch.from_numpy(frames[0].astype(np.float32) / 255.0)


# --- JOD -------------------------------------------------------------------------------------------------------------


def test_jod_is_ten_for_no_difference_and_falls_with_noise() -> None:
    scores = [jod(noisy(amount), still(), 60.0, AT_60) for amount in (0.0, 3.0, 10.0, 30.0)]
    assert scores[0] == pytest.approx(10.0, abs=1e-3)
    assert all(worse < better - 0.1 for better, worse in pairwise(scores))


def test_the_declared_rate_matters() -> None:
    """The same pixels, shown twice as fast."""
    at_60, at_120 = jod(noisy(10.0), still(), 60.0, AT_60), jod(noisy(10.0), still(), 120.0, AT_120)
    assert abs(at_60 - at_120) > 0.01


@pytest.mark.parametrize(("rate_hz", "display", "times"), [(30.0, AT_60, 2), (20.0, AT_60, 3), (60.0, AT_120, 2)])
def test_slower_images_stay_for_several_refreshes(rate_hz: float, display: DisplayModel, times: int) -> None:
    assert display.repeats(rate_hz) == times and display.repeats(display.rate_hz) == 1
    test, reference = noisy(10.0)[:3], still()[:3]
    held = jod(test.repeat(times, axis=0), reference.repeat(times, axis=0), display.rate_hz, display)
    found = jod(test, reference, rate_hz, display)
    assert found == held != jod(test, reference, display.rate_hz, display)


@pytest.mark.parametrize("rate_hz", [25.0, 59.94, 45.0, 120.0, -60.0])
def test_a_rate_that_the_display_cannot_hold_is_refused(rate_hz: float) -> None:
    message = rf"reference_rate_hz: expected a whole fraction of the display's 60 Hz, got {rate_hz}"
    with pytest.raises(ConfigError, match=message):
        AT_60.repeats(rate_hz)
    with pytest.raises(ConfigError, match=message):
        jod(still(), still(), rate_hz, AT_60)


def test_other_displays_and_shapes_are_refused() -> None:
    with pytest.raises(ConfigError, match=r"display.rate_hz: expected 60 or 120, got 50.0"):
        DisplayModel(rate_hz=50.0)
    for name in ("foo", "standard_hdr_pq"):  # the second shows no sRGB
        with pytest.raises(ConfigError, match=rf"display.name: expected one of standard_4k, .*got '{name}'"):
            DisplayModel(name)
    assert DisplayModel("standard_4k").name == "standard_4k"
    with pytest.raises(ValueError, match=r"equal shapes, got \(5, 64, 64, 3\) and \(6, 64, 64, 3\)"):
        jod(still()[:5], still(), 60.0, AT_60)


# --- threads ---------------------------------------------------------------------------------------------------------


@pytest.fixture
def threads():
    """Puts the number of threads back after the test, which sets it."""
    before = torch.get_num_threads()
    yield
    torch.set_num_threads(before)


def test_scores_do_not_depend_on_the_number_of_threads(threads: None, monkeypatch: pytest.MonkeyPatch) -> None:
    import kornia.metrics

    jod(still()[:1], still()[:1], 60.0, AT_60)  # imports the metric
    import pycvvdp

    seen: list[int] = []

    def spied(owner: object, name: str) -> None:
        measure = getattr(owner, name)

        def wrapped(*args, **options):
            seen.append(torch.get_num_threads())
            return measure(*args, **options)

        monkeypatch.setattr(owner, name, wrapped)

    spied(pycvvdp.cvvdp, "predict")
    spied(kornia.metrics, "ssim")
    scores = []
    for number in (1, 2):
        torch.set_num_threads(number)
        found = jod(noisy(10.0), still(), 60.0, AT_60)
        images = encoded(noisy(10.0)), encoded(still())
        scores.append((found, flip(*images), ssim(*images)))
        assert torch.get_num_threads() == number
    assert scores[0] == scores[1]
    assert seen == [1, 1, 1, 1], "both measure on one"


SEVERAL = """
import numpy as np
import torch
from concurrent.futures import ThreadPoolExecutor
from analysis.metrics.display_model import DisplayModel
from analysis.metrics.perceptual import jod

frames = np.random.default_rng(0).integers(0, 256, (6, 64, 64, 3)).astype(np.uint8)
with ThreadPoolExecutor(4, initializer=torch.set_num_threads, initargs=(1,)) as pool:
    found = set(pool.map(lambda _: jod(frames, frames // 2, 60.0, DisplayModel()), range(8)))
assert found == {jod(frames, frames // 2, 60.0, DisplayModel())}, found
"""


def test_several_threads_score_alike() -> None:
    """In a process of its own, in which all of them load the metric first."""
    done = subprocess.run([sys.executable, "-c", SEVERAL], cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0 and not done.stderr, done.stderr


def test_nothing_is_printed(capfd: pytest.CaptureFixture[str]) -> None:
    """The progress of a script is not written over."""
    jod(noisy(3.0)[:2], still()[:2], 60.0, AT_60)
    assert capfd.readouterr() == ("", "")


# --- FLIP and SSIM ---------------------------------------------------------------------------------------------------


def test_flip_is_nothing_for_equal_images_and_grows() -> None:
    scores = [flip(encoded(noisy(amount)), encoded(still())) for amount in (0.0, 3.0, 10.0, 30.0)]
    assert scores[0] == 0.0 and scores[-1] < 1.0
    assert all(worse > better + 0.005 for better, worse in pairwise(scores))


def test_ssim_is_one_for_equal_images_and_falls() -> None:
    scores = [ssim(encoded(noisy(amount)), encoded(still())) for amount in (0.0, 3.0, 10.0, 30.0)]
    assert scores[0] == pytest.approx(1.0, abs=1e-6) and scores[-1] > 0.0
    assert all(worse < better - 0.005 for better, worse in pairwise(scores))


# --- torchvision -----------------------------------------------------------------------------------------------------

IMPORT = """
import torch
from analysis.metrics import torchvision_operators as operators

loads = operators._extension_loads
operators._extension_loads = lambda: True
operators.declare_missing()
assert not hasattr(torch.ops.torchvision, "nms"), "an extension that loads declares its own"
operators._extension_loads = loads
operators.declare_missing()
library = operators._declared
operators.declare_missing()
assert operators._declared is library
operators._declared = None
operators.declare_missing()
assert operators._declared is None, "what is declared already, by whomever, stays"
operators._declared = library
import torchvision
from torchvision import transforms
"""


def test_torchvision_can_be_imported_once_its_operators_are_declared() -> None:
    """In a process of its own: what is declared once stays."""
    done = subprocess.run([sys.executable, "-c", IMPORT], cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr


def test_the_metric_asks_for_the_declaration(monkeypatch: pytest.MonkeyPatch) -> None:
    from analysis.metrics import torchvision_operators

    asked: list[None] = []
    declare = torchvision_operators.declare_missing
    monkeypatch.setattr(torchvision_operators, "declare_missing", lambda: asked.append(declare()))
    jod(still()[:1], still()[:1], 60.0, AT_60)
    assert asked == [None]
