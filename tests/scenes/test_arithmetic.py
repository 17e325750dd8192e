"""Functions that round the same on every processor, and a check that code that builds scenes uses no others."""

from __future__ import annotations

import ast
import math
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from scenes import arithmetic

ROOT = Path(__file__).resolve().parents[2]
ANGLES = np.random.default_rng(0).uniform(-20.0, 20.0, 1000)
SHARES = np.random.default_rng(1).uniform(-1.0, 1.0, 1000)

ROOMS = ("scenes", "renderer/tables", "renderer/sampling")
LEFT = tuple(f"scenes/formats/geometry/{name}.py" for name in ("recognition", "cubes", "round_shapes"))
LEFT += ("scenes/arithmetic.py",)
"""The first find shapes in meshes of files by least squares; the last is what all others use."""

BANNED = {
    "np": "sin cos tan exp log log2 log10 hypot sinh cosh tanh expm1 log1p cbrt arcsin arccos arctan arctan2".split(),
    "math": "sin cos tan exp log log2 log10 hypot sinh cosh tanh expm1 log1p cbrt asin acos atan atan2 pow".split(),
    "np.linalg": "inv solve lstsq eigh eig qr cholesky pinv".split(),
    "Rotation": "from_rotvec from_euler from_mrp align_vectors".split(),
}
BANNED["np"] += "power float_power exp2 einsum dot tensordot inner matmul vdot".split()
NAMES = {"Slerp", "gaussian_filter", "kornia"}


def breaches(source: str) -> list[str]:
    """Calls in a file whose last bit depends on the processor, a line each."""
    found = []
    for node in ast.walk(ast.parse(source)):
        what = ""
        if isinstance(node, ast.Attribute) and node.attr in BANNED.get(ast.unparse(node.value), ()):
            what = ast.unparse(node)
        elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.MatMult):
            what = "@"
        elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow) and not isinstance(node.left, ast.Constant):
            # NumPy squares by a product
            square = isinstance(node.right, ast.Constant) and node.right.value == 2
            what = "" if square else ast.unparse(node)
        elif isinstance(node, ast.Call) and ast.unparse(node.func) == "np.linalg.norm" and not node.keywords:
            what = "np.linalg.norm of one vector, which is a BLAS product"
        elif isinstance(node, ast.ImportFrom | ast.Import):
            words = set(ast.unparse(node).replace(".", " ").replace(",", " ").split())
            what = " ".join(words & NAMES)
        if what:
            found.append(f"line {node.lineno}: {what}")
    return found


def builders() -> list[str]:
    """Files of the code that makes scenes, the tables of the renderer and the points that it samples."""
    paths = (path.relative_to(ROOT).as_posix() for room in ROOMS for path in sorted((ROOT / room).rglob("*.py")))
    return [path for path in paths if path not in LEFT]


@pytest.mark.parametrize("path", builders())
def test_nothing_that_builds_scenes_rounds_as_the_processor_does(path: str) -> None:
    assert breaches((ROOT / path).read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    "line",
    [
        "a @ b",
        "np.sin(x)",
        "math.atan2(y, x)",
        "np.linalg.inv(m)",
        "np.linalg.norm(v)",
        "x**0.45",
        "x**n",
        "Rotation.from_rotvec(v)",
        "from scipy.ndimage import gaussian_filter",
        "import kornia.color",
    ],
)
def test_breaches_are_found(line: str) -> None:
    assert breaches(line)
    assert not breaches("sin(x) + x**2 + np.linalg.norm(v, axis=1) + 2.0**-24")


@pytest.mark.parametrize("name", "sin cos tan arctan exp expm1".split())
def test_functions_of_any_number(name: str) -> None:
    assert getattr(arithmetic, name)(ANGLES) == pytest.approx(getattr(np, name)(ANGLES), rel=1e-14, abs=1e-15)


@pytest.mark.parametrize("name", "arcsin arccos log1p".split())
def test_functions_of_shares(name: str) -> None:
    assert getattr(arithmetic, name)(SHARES) == pytest.approx(getattr(np, name)(SHARES), rel=1e-14)


def test_functions_of_two_numbers() -> None:
    base = np.abs(ANGLES)
    assert arithmetic.power(base, SHARES) == pytest.approx(base**SHARES, rel=1e-14)
    assert arithmetic.log(base) == pytest.approx(np.log(base), rel=1e-14, abs=1e-15)
    assert arithmetic.hypot(ANGLES, SHARES) == pytest.approx(np.hypot(ANGLES, SHARES), rel=1e-14)
    assert arithmetic.arctan2(ANGLES, SHARES) == pytest.approx(np.arctan2(ANGLES, SHARES), rel=1e-14)
    assert isinstance(arithmetic.sin(1.0), float) and arithmetic.sin(np.float32(1.0)).dtype == np.float64


def test_the_determinant_is_that_of_the_linear_part() -> None:
    for matrix in np.random.default_rng(3).normal(size=(20, 4, 4)):
        assert arithmetic.determinant(matrix) == pytest.approx(np.linalg.det(matrix[:3, :3]), rel=1e-9)
    assert arithmetic.determinant(np.diag([2.0, -3.0, 0.0])) == 0.0


def test_products_are_those_of_matrices() -> None:
    rng = np.random.default_rng(2)
    matrix, points, vector = rng.normal(size=(3, 3)), rng.normal(size=(7, 3)), rng.normal(size=3)
    many = rng.normal(size=(5, 3, 3))
    for first, second in ((matrix, matrix), (points, matrix), (matrix, vector), (vector, matrix), (many, matrix)):
        found = arithmetic.product(first, second)
        assert found.shape == (first @ second).shape and np.allclose(found, first @ second, rtol=1e-14)
    assert arithmetic.products(points, matrix, vector) == pytest.approx(points @ matrix @ vector, rel=1e-12)
    assert arithmetic.product(vector, vector) == pytest.approx(vector @ vector, rel=1e-14)
    assert arithmetic.norm(vector) == pytest.approx(np.linalg.norm(vector), rel=1e-14)
    for _ in range(50):  # two transforms take another way to the same bits
        first, second = (
            rng.normal(size=(2, 4, 4)) * 10.0 ** rng.uniform(-8.0, 8.0, (2, 4, 4)) * rng.integers(-1, 2, (4, 4))
        )
        assert arithmetic.product(first, second).tobytes() == arithmetic.product(first[None], second)[0].tobytes()
    # from the first term to the last, where another order would lose the small one
    assert arithmetic.product((1e16, 1.0, -1e16), (1.0, 1.0, 1.0)) == 0.0


@pytest.mark.parametrize("size", [1e-150, 1.0, 1e150])
def test_inverses_are_those_of_matrices(size: float) -> None:
    rng = np.random.default_rng(3)
    for width in (3, 4):
        matrix = rng.normal(size=(width, width))
        assert arithmetic.inverse(size * matrix) * size == pytest.approx(np.linalg.inv(matrix), rel=1e-11)
    assert np.array_equal(arithmetic.inverse(np.diag([2.0, 4.0, 0.5, 1.0])), np.diag([0.5, 0.25, 2.0, 1.0]))
    with pytest.raises(np.linalg.LinAlgError):
        arithmetic.inverse(np.ones((3, 3)))


def test_rotations_are_those_of_scipy() -> None:
    axis = np.array([0.0, 0.6, 0.8])
    expected = Rotation.from_rotvec(ANGLES[:, None] * axis).as_matrix()
    assert arithmetic.rotation_about(axis, ANGLES).as_matrix() == pytest.approx(expected, abs=1e-14)
    assert arithmetic.rotation_about(axis, 0.5).as_matrix() == pytest.approx(
        Rotation.from_rotvec(0.5 * axis).as_matrix(), abs=1e-15
    )


@pytest.mark.parametrize("apart", [0.0, 1e-12, 1e-6, 0.1, 3.0])
def test_rotations_between_are_those_of_scipy(apart: float) -> None:
    start, share = Rotation.from_euler("xyz", [0.3, -1.0, 2.0]), np.linspace(0.0, 1.0, 11)
    keys = Rotation.concatenate([start, start * Rotation.from_rotvec([0.0, 0.6 * apart, 0.8 * apart])])
    first, second = keys.as_quat()
    expected = Slerp([0.0, 1.0], keys)(share).as_matrix()
    for sign in (1.0, -1.0):
        found = arithmetic.rotation_between(np.tile(first, (11, 1)), np.tile(sign * second, (11, 1)), share)
        assert found.as_matrix() == pytest.approx(expected, abs=1e-12)
    assert math.isclose(
        arithmetic.rotation_between(first, second, 0.5).magnitude(), Slerp([0, 1], keys)(0.5).magnitude()
    )
