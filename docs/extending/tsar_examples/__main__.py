"""Uses everything that this package adds, by name, as any user of it would."""

import tempfile
from pathlib import Path

from analysis import compare
from renderer import render
from tsar import ErrorConfig, ReconstructionConfig, ResponseConfig

SMALL = {"seconds": 0.3, "resolution_px": 64, "batch_size": 16, "warmup_cycles": 8, "reference_samples_per_axis": 1}


def main() -> None:
    """Prints a table of two comparisons, and the mean of two pictures."""
    print(compare("pendulum", ["interlaced", "framed"], ["edges"], **SMALL).table().to_string())
    changed = {
        "response": ResponseConfig(solver="cautious"),
        "error": ErrorConfig(norm="mean"),
        "reconstruction": ReconstructionConfig(method="smooth"),
    }
    result = compare("pendulum", ["thesis", "interlaced"], **SMALL, **changed)
    print(result.table().to_string())
    print("added:", *(f"{one.kind} {one.name}" for one in result.summary["provenance"]["added"]), sep="\n  ")
    print(f"picture: {render('pendulum', 64, point_set='r3', samples_per_pixel=8).mean():.3f}")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "two.balls"
        file.write_text("-1 0 0 1\n1.2 0 0.5 0.8\n", encoding="utf-8")
        print(f"picture of a file: {render(file, 64, samples_per_pixel=8).mean():.3f}")


if __name__ == "__main__":
    main()
