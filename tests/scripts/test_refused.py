"""Bad input of every command: status 2, one line that says what was expected and what arrived, and nothing written."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest

from tests.scripts.commands import assert_refused, call_script, nothing_in

SMALL = "--resolution-px 64 --batch-size 16"
CACHED = ("run", "sensitivity", "suitability", "ablation", "precision", "workloads")
"""Commands that have a cache of references."""

REFUSED: dict[str, tuple[str, ...]] = {
    "ablation --inputs nowhere": ("inputs", "nowhere"),
    "ablation --rows 16": ("rows", "0 to 15"),
    "ablation --rows 7 7": ("rows", "none twice"),
    "ablation --parts magic": ("parts", "jitter", "footprint-1x", "magic"),
    "ablation --parts jitter jitter": ("parts", "none twice"),
    "ablation --rivals nobody": ("rivals", "nobody"),
    "ablation --before-s 0": ("before_s", "between 0.001 and 10", "0.0"),
    "ablation --repetitions 0": ("repetitions", "between 1 and 1000"),
    "ablation --ledger wall": ("ledger", "wall"),
    "ablation --scale huge": ("--scale", "huge"),
    "accelerators --triangles 3": ("triangles", "between 16", "3"),
    "accelerators --image-scale 0": ("image_scale", "0"),
    "accelerators --image report-three": ("report-three",),
    "bench --only order,nonsense": ("only", "nonsense"),
    "bench --repetitions 3": ("repetitions", "3"),
    "bench --resolution-px 100": ("resolution_px", "100"),
    "bench --scenes nonsense --only order": ("nonsense", "fly-by"),
    "bench --compare missing-a.json missing-b.json": ("compare", "missing-a.json"),
    "bench --nonsense": ("--nonsense",),
    "conversion_check gone.xml": ("scenes", "scene files"),
    "conversion_check": ("scenes", "scene files, --markers, --matrix or --mutations"),
    f"conversion_check --width-px 2 {__file__}": ("width_px", "between 16 and 4096"),
    "cost_report --batch-size -1": ("batch_size", "-1"),
    "cost_report --trace-segments nan": ("trace_segments", "nan"),
    "cost_report --tree-size 1": ("tree_size", "1"),
    "cost_report --ledger wall": ("--ledger", "wall"),
    "cost_report --batches 0 32": ("batches", "between 1 and 1048576"),
    "cost_report --measured-resolutions 100 200 300": ("resolution_px", "power of two", "100"),
    "cost_report --repetitions 0": ("repetitions", "0"),
    "cost_report --input nonsense": ("nonsense", "fly-by"),
    "cost_report --nonsense": ("--nonsense",),
    "gallery fog": ("effects", "one of plain", "fog"),
    "gallery plain --samples 26 --point-set stratified": ("expected a cube of samples", "27", "26"),
    "gallery plain --width-px 0": ("width_px", "0"),
    "inputs --repetitions 0": ("repetitions", "between 1 and 1000", "0"),
    "inputs --vary weather": ("--vary", "weather"),
    "inputs --seconds 0": ("seconds", "between 1e-06 and"),
    "inputs --capacity -1": ("capacity", "-1.0"),
    "live nowhere": ("nowhere", "fly-by"),
    "live fly-by --left nobody": ("left", "nobody"),
    "live fly-by --right oracle": ("right", "truth"),
    "live fly-by --left tsar": ("right", "another policy"),
    "live fly-by --batch-size 1024 --resolution-px 64": ("batch_size", "1024"),
    "live fly-by --latency-cycles 9": ("latency_cycles", "9"),
    "live fly-by --port 70000": ("port", "70000"),
    "live whole-sphere": ("camera", "perspective or orthographic", "EnvironmentCamera"),
    "live gone.session": ("gone.session", "found none"),
    "live fly-by --bench-seconds 0": ("bench_seconds", "0"),
    "perception stimuli gone.txt": ("gone.txt", "cannot be read"),
    "perception stimuli --width-px 4": ("width_px", "4"),
    "perception simulate nowhere": ("manifest.json", "stimuli"),
    "perception recover --jnds 1000": ("jnds", "between 1 and 512", "1000"),
    "perception analyse nowhere.parquet": ("nowhere.parquet", "cannot be read"),
    "perception serve ' '": ("observer", "a name"),
    "perception sing": ("expected one of stimuli, simulate", "got 'sing'"),
    "perception stimulii": ("expected one of stimuli, simulate", "got 'stimulii' (nearest: stimuli)"),
    "pointsets --levels 8 27 60": ("levels", "cubes", "60"),
    "pointsets --levels 8 27": ("levels", "at least three"),
    "pointsets --cases 0": ("cases", "0"),
    "workloads --inputs nowhere": ("inputs", "nowhere"),
    "workloads --policies nobody": ("policies", "nobody"),
    "workloads --sample-flops 0": ("sample_flops", "between 1", "0.0"),
    "workloads --sides-px 300": ("sides_px", "512", "300"),
    "workloads --image-hz 8 8": ("image_hz", "none twice"),
    "precision --inputs nowhere": ("inputs", "nowhere"),
    "precision --row 16": ("row", "0 to 15"),
    "precision --policies tsar tsar": ("policies", "none twice"),
    "precision --kept magic": ("kept", "colors", "densities", "magic"),
    "precision --policies tsar --kept wavelets": ("kept", "colors", "wavelets"),
    "precision --tolerance -1": ("tolerance", "between 0"),
    "render nonsense": ("scene", "'nonsense'"),
    "render fly-by --width-px -1": ("width_px", "-1"),
    "render fly-by --frames -3": ("frames", "-3"),
    "render fly-by --fps 0": ("fps", "between 1e-06 and"),
    "render fly-by --time-s inf": ("time_s", "inf"),
    "render fly-by --samples-per-axis 65": ("samples_per_axis", "65"),
    "render fly-by --camera 1 2 3": ("--camera: expected 6 numbers or a name, got '1', '2', '3'",),
    "render fly-by --format gif": ("gif", "png"),
    "render fly-by --phase 1": ("phase", "1.0"),
    "render fly-by --threads -1": ("threads", "-1"),
    "run fly-by --batch-size -1": ("batch_size", "-1"),
    "run fly-by --batch-size many": ("--batch-size", "many"),
    "run fly-by --preset fast": ("--preset: expected one of draft, balanced, accurate, got 'fast'",),
    "run fly-by --budget-flops 1": ("budget_flops: expected at least", "the front", "got 1"),
    "run fly-by --capacity 0": ("capacity", "between 1e-12 and", "0.0"),
    "run fly-by --capacity nan": ("capacity", "nan"),
    "run fly-by --resolution-px 100": ("resolution_px", "power of two", "100"),
    "run fly-by --solver magic": ("solver", "magic", "waterfill"),
    "run fly-by --seconds -2": ("seconds", "-2.0"),
    "run fly-by --warmup-cycles 2": ("warmup_cycles", "at least 4"),
    "run fly-by --nonsense": ("--nonsense",),
    "run": ("required",),
    f"run nonsense {SMALL}": ("scene", "fly-by", "'nonsense'"),
    f"run fly-by --phase 1 {SMALL}": ("phase", "[0, 1)", "1.0"),
    "sensitivity --inputs moon": ("inputs", "moon"),
    "sensitivity --row 16": ("row", "16"),
    "sensitivity --scale huge": ("--scale", "huge"),
    "sensitivity --still-s -1": ("still_s", "-1"),
    "sensitivity --figure-input fly-by --inputs chase": ("figure_input", "fly-by"),
    "sensitivity --spatial-slopes -1 -1": ("spatial_slopes", "none twice"),
    "sensitivity --spatial-slopes 99": ("spatial_slopes", "99"),
    "sensitivity --offsets nan": ("offsets", "nan"),
    "sensitivity --biases 9": ("biases", "9"),
    "sensitivity --repetitions 0": ("repetitions", "0"),
    "sensitivity --ledger wall": ("ledger", "wall"),
    "sensitivity --workers -1": ("workers", "-1"),
    "sensitivity --nonsense": ("--nonsense",),
    "spectrum --ideal-samples 100": ("ideal_samples", "100"),
    "spectrum --inputs car": ("inputs", "car"),
    "spectrum --only colours": ("only", "colours"),
    "spectrum --only ideal --ideal-samples 1024 --ideal-frames 32768": ("ideal_samples", "GiB"),
    "spectrum --tau 2": ("tau", "2"),
    "suitability --inputs nowhere": ("inputs", "nowhere"),
    "suitability --rows 16": ("rows", "0 to 15"),
    "suitability --scale huge": ("--scale", "huge"),
    "suitability --repetitions 0": ("repetitions", "between 1 and 1000"),
    "suitability --ledger wall": ("ledger", "wall"),
    "suitability --workers -1": ("workers", "-1"),
    "suitability --display.rate-hz 75": ("rate_hz", "60 or 120"),
    "suitability --framed-rate-hz 0": ("framed_rate_hz", "between 0.01 and 1000"),
    "tiles fog": ("scene", "one of", "fog"),
    "tiles plain --samples 9 --point-set stratified": ("expected a cube of samples", "9"),
    "tiles plain --scheduler nowhere": ("scheduler", "nowhere"),
    "tiles plain --study 0": ("study", "0"),
}
"""Command lines, and parts of the message of each."""


@pytest.mark.parametrize("line", REFUSED)
def test_bad_input_is_refused(
    line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    monkeypatch.chdir(tmp_path)
    name, *arguments = shlex.split(line)
    arguments += ["--out", "out"] if line not in ("perception sing", "perception stimulii") else []
    arguments += ["--references", "cache"] if name in CACHED else []
    assert_refused(call_script(f"{name}.py", monkeypatch, *arguments), capsys, REFUSED[line])
    assert nothing_in(tmp_path / "out") and nothing_in(tmp_path / "cache")
