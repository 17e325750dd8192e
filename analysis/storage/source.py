"""The code that made a result: a hash of all files and versions that decide it, found by following imports.

A stored result is reused if this hash is the same. No list of files has to be kept: the hash covers everything that a
module imports, wherever it lies, and all files beside it that are not Python, such as C++ headers and assets.
"""

from __future__ import annotations

import ast
import hashlib
import importlib.metadata
import importlib.util
import re
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

from tsar.named import Named

_PACKAGES = ("tsar", "renderer", "scenes", "analysis")

_NO_DATA = (".pyc", ".md", ".html", ".js")
"""Endings of files beside the code that affect no result: pages only show them."""

_PLACE = re.compile(r"[a-z_]\w*(\.\w+)+:\w+")
"""An entry in a table of names, as ``module:attribute``, which is imported at its first use."""

_DISTRIBUTIONS = {
    "warp": "warp-lang", "PIL": "pillow", "pycvvdp": "cvvdp", "flip_evaluator": "flip-evaluator", "pxr": "usd-core",
}  # fmt: skip
"""Distribution names of packages that differ from their import names."""


def code_hash(*makers: Any) -> str:
    """Hash of the code of classes or functions.

    It covers the modules that define them, all modules of the same checkout that these import directly or indirectly,
    all files other than Python in and below the folders of these modules, and the versions of Python and of all
    libraries that any of the modules imports.

    Args:
        makers: classes and functions, all of one checkout.

    Returns:
        16 hexadecimal digits.
    """
    return hash_of_modules(*_found(makers))


def hash_of_modules(root: Path, starts: Sequence[Path]) -> str:
    """As :func:`code_hash`, from the folder of the packages and the files of modules in them."""
    modules, libraries = _reached(root, starts)
    digest = hashlib.sha256()
    for path in sorted({*modules, *_data(modules)}, key=lambda path: path.parts):  # Windows would order without case
        content = hashlib.sha256(path.read_bytes()).hexdigest()
        digest.update(f"{path.relative_to(root).as_posix()} {content}\n".encode())
    for name in sorted(libraries):
        digest.update(f"{name} {version_of(name)}\n".encode())
    digest.update(f"python {sys.version_info.major}.{sys.version_info.minor}\n".encode())
    return digest.hexdigest()[:16]


def _found(makers: Sequence[Any]) -> tuple[Path, list[Path]]:
    """The folder of all packages, and the files of the modules that define the makers."""
    files = [Path(sys.modules[maker.__module__].__file__ or "").resolve() for maker in makers]
    return files[0].parents[makers[0].__module__.count(".")], files


@dataclass(frozen=True)
class Brought:
    """A table entry that another package or program added.

    Attributes:
        kind, name: its kind, and its name in the table.
        module, distribution, version: its origin; see :class:`tsar.named.Origin`.
        content: hash of the files of its package, or of its module if that is in no package; None without a file.
    """

    kind: str
    name: str
    module: str
    distribution: str | None
    version: str | None
    content: str | None


def brought(*chosen: tuple[Named[Any], str]) -> list[Brought]:
    """Those of the chosen entries that were added from elsewhere, which the hash of the project's code does not
    cover."""
    found = []
    for table, name in chosen:
        if not table.is_own(name):
            origin = table.origin(name)
            content = _content(origin.module)
            found.append(Brought(table.kind, name, origin.module, origin.distribution, origin.version, content))
    return found


def _content(module: str) -> str | None:
    """Hash of all files of the package of a module, or of its own file if it is in no package."""
    top = module.partition(".")[0]
    spec = None if top == "__main__" else importlib.util.find_spec(top)
    if spec is not None and spec.submodule_search_locations:
        paths = sorted(path for folder in spec.submodule_search_locations for path in Path(folder).rglob("*"))
        paths = [path for path in paths if path.is_file() and path.suffix != ".pyc"]
    else:
        file = spec.origin if spec else getattr(sys.modules.get(top), "__file__", None)
        paths = [Path(file)] if file and Path(file).is_file() else []
    digest = hashlib.sha256()
    for path in paths:
        digest.update(f"{path.name} {hashlib.sha256(path.read_bytes()).hexdigest()}\n".encode())
    return digest.hexdigest()[:16] if paths else None


@cache
def version_of(library: str) -> str | None:
    """Version of an installed library by its import name; None if it is not installed."""
    try:
        return importlib.metadata.version(_DISTRIBUTIONS.get(library, library))
    except importlib.metadata.PackageNotFoundError:
        return None


def _reached(root: Path, starts: Sequence[Path]) -> tuple[set[Path], set[str]]:
    """Modules that are reached by imports, and names of the libraries that they import."""
    modules, libraries, waiting = set[Path](), set[str](), list(starts)
    # installed packages lie beside other packages
    own = {*_PACKAGES, *(path.relative_to(root).with_suffix("").parts[0] for path in starts)}
    module = cache(lambda name: _module(root, name))  # most names occur in many files
    while waiting:
        path = waiting.pop()
        if path in modules:
            continue
        modules.add(path)
        content = path.read_bytes()
        for place in _places(content):
            waiting += module(place) if place.partition(".")[0] in own else []
        for name in _imports(content, path.parent.relative_to(root).parts):
            top = name.partition(".")[0]
            found = module(name) if top in own else []
            waiting += found
            if not found and top not in sys.stdlib_module_names:
                libraries.add(top)
    return modules, libraries


def _module(root: Path, name: str) -> list[Path]:
    """Files of a dotted name below the root: its module, or the module that defines it, and the packages above it.

    For a name that a package itself defines these are all files of the package, because it may take the name from any
    module in it.
    """
    folder, found = root, list[Path]()
    for part in name.split("."):
        if (folder / f"{part}.py").is_file():
            return [*found, folder / f"{part}.py"]
        if not (folder / part).is_dir():
            break
        folder = folder / part
        if (folder / "__init__.py").is_file():
            found.append(folder / "__init__.py")
    return found if folder == root else [*found, *folder.rglob("*.py")]


@lru_cache(maxsize=4096)
def _imports(content: bytes, package: tuple[str, ...]) -> tuple[str, ...]:
    """Dotted names of all imports of a module of a package, anywhere in it except those for type checkers alone."""
    return tuple(_names(ast.parse(content), package))


@lru_cache(maxsize=4096)
def _places(content: bytes) -> tuple[str, ...]:
    """Dotted names of modules to which the tables of names refer."""
    texts = (node.value for node in ast.walk(ast.parse(content)) if isinstance(node, ast.Constant))
    return tuple(text.replace(":", ".") for text in texts if isinstance(text, str) and _PLACE.fullmatch(text))


def _names(tree: ast.AST, package: tuple[str, ...]) -> Iterator[str]:
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) - node.level + 1] if node.level else ()
            base = ".".join([*above, *([node.module] if node.module else [])])
            yield from (f"{base}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            for other in node.orelse:
                yield from _names(ast.Module([other], []), package)
        elif isinstance(node, ast.stmt | ast.ExceptHandler | ast.match_case):
            yield from _names(node, package)


def _data(modules: set[Path]) -> Iterator[Path]:
    """Files beside and below modules that are not Python."""
    folders = {module.parent for module in modules}
    for folder in folders:
        if folders.isdisjoint(folder.parents):
            for path in folder.rglob("*"):
                if path.suffix != ".py" and path.suffix not in _NO_DATA and path.is_file():
                    yield path
