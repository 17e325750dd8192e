"""Reader of directive files: includes, transforms and attributes. A dialect defines the other directives.

Source: PBRT v3 file format (https://www.pbrt.org/fileformat-v3).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from scenes.arithmetic import affine
from scenes.canonical import Material, Medium, SceneError
from scenes.canonical.values import Matrix
from scenes.formats.directives.names import Names
from scenes.formats.directives.syntax import Directive, Parameters, Values, parameters_of, parse_directives
from scenes.formats.geometry.transform_stack import (
    TransformStack,
    inverse,
    invertible,
    looking,
    rotation,
    scaling,
    translation,
)
from scenes.formats.losses import HINTS, LossReport
from scenes.formats.text.places import TextPosition
from scenes.formats.text.scene_files import DEPTH_MAX, SceneFiles

SAVED_MAX = 1024
"""Maximum depth of attribute blocks."""


@dataclass
class Attributes:
    """State that ``AttributeBegin`` saves in addition to the transform."""

    material: Material | None = None
    emission: tuple[float, float, float] | None = None
    emission_twosided: bool = False
    power: float = 0.0  # power to which the emission is scaled, lumens; 0 for none
    reversed: bool = False
    interior: Medium | None = None  # media of both sides, as given; see SceneReader.drawn
    exterior: Medium | None = None
    # parameters for the following directives, by target and name
    assumed: Mapping[tuple[str, str], tuple[Values, Values]] = field(default_factory=dict)


@dataclass
class OpenBlock:
    """An open block: its kind, the state that it restores, and the mark of its names."""

    kind: str
    attributes: Attributes | None
    names: int


@dataclass
class DirectiveReader:
    """State of reading a file; a dialect adds the directives that describe a scene.

    Attributes:
        files: files that may be read.
        report: receives the losses.
        left_handed: whether ``LookAt`` assumes a left-handed world with x to the right.
    """

    files: SceneFiles
    report: LossReport
    left_handed: bool = True
    transforms: TransformStack = field(default_factory=TransformStack)
    attributes: Attributes = field(default_factory=Attributes)
    names: Names = field(default_factory=Names)
    _saved: list[OpenBlock] = field(default_factory=list)
    _file: Path | None = None
    _known: dict[str, Callable[[Directive], None]] = field(default_factory=dict)

    def read(self, path: Path) -> None:
        """Reads a file and its includes.

        Raises:
            SceneError: the file is invalid; the message gives file, line and column.
        """
        for directive in parse_directives(self.files.text(path, str(path)), path, self._open):
            self._file = directive.file
            self._do(directive)

    def _open(self, name: str, place: TextPosition, inside: tuple[Path, ...]) -> tuple[str, Path]:
        """Text and path of an included file."""
        path, where = self.files.path(name, str(place), inside[-1]), str(inside[-1])
        if path in inside:
            raise SceneError(f"{where}: expected files that do not include themselves, {path.name} does")
        if len(inside) >= DEPTH_MAX:
            raise SceneError(f"{where}: expected at most {DEPTH_MAX} files inside each other")
        return self.files.text(path, where), path

    def finish(self) -> None:
        """Raises SceneError if a block is still open."""
        if self._saved:
            raise SceneError(f"{self.files.main}: expected every block to end, {self._saved[-1].kind}Begin does not")

    @property
    def beside(self) -> Path:
        """The file that is being read, beside which others are searched."""
        return self._file or self.files.main

    def dialect(self) -> dict[str, Callable[[Directive], None]]:
        """Directives of the dialect by name."""
        raise NotImplementedError

    def _do(self, directive: Directive) -> None:
        if not self._known:
            self._known.update({**self._common(), **self.dialect()})
        own = self._known.get(directive.name)
        if own is None:
            raise SceneError(f"{directive.place}: expected a directive, got {directive.name!r}")
        own(directive)

    def _common(self) -> dict[str, Callable[[Directive], None]]:
        apply = self.transforms.apply
        return {
            "Identity": lambda d: self.transforms.replace(np.eye(4)),
            "Translate": lambda d: apply(translation(*numbers(d, 3))),
            "Scale": lambda d: apply(checked(d, scaling(*numbers(d, 3)))),
            "Rotate": lambda d: apply(rotation(*numbers(d, 4))),
            "LookAt": self._look_at,
            "Transform": lambda d: self.transforms.replace(checked(d, matrix(d))),
            "ConcatTransform": lambda d: apply(checked(d, matrix(d))),
            "CoordinateSystem": self._name_system,
            "CoordSysTransform": self._take_system,
            # "ActiveTransform StartTime" is two bare words
            "ActiveTransform": lambda d: None,
            "StartTime": lambda d: setattr(self.transforms, "active", (True, False)),
            "EndTime": lambda d: setattr(self.transforms, "active", (False, True)),
            "All": lambda d: setattr(self.transforms, "active", (True, True)),
            "TransformTimes": self._set_times,
            "AttributeBegin": lambda d: self._begin("Attribute", d),
            "AttributeEnd": lambda d: self._end("Attribute", d),
            "TransformBegin": lambda d: self._begin("Transform", d),
            "TransformEnd": lambda d: self._end("Transform", d),
            "ReverseOrientation": lambda d: setattr(self.attributes, "reversed", not self.attributes.reversed),
        }

    def _look_at(self, directive: Directive) -> None:
        eye, target, up = np.array(numbers(directive, 9)).reshape(3, 3)
        found = looking(eye, target, up, self.left_handed)
        if found is None:
            raise SceneError(f"{directive.place}: LookAt: expected an upward direction across the line of sight")
        self.transforms.apply(inverse(found))

    def _name_system(self, directive: Directive) -> None:
        self.transforms.named[word(directive)] = [part.copy() for part in self.transforms.current]

    def _take_system(self, directive: Directive) -> None:
        name = word(directive)
        if name not in self.transforms.named:
            self.report.add(str(directive.place), f"coordinate system {name!r}, which is not defined")
        else:
            self.transforms.take(name)

    def _set_times(self, directive: Directive) -> None:
        start, end = numbers(directive, 2)
        self.transforms.times_s = start, end

    def _begin(self, kind: str, directive: Directive) -> None:
        if len(self._saved) >= SAVED_MAX:
            raise SceneError(f"{directive.place}: expected at most {SAVED_MAX} blocks inside each other")
        self.transforms.push()
        saved = None
        if kind != "Transform":  # as copy.copy does, in a fifth of its time
            saved = object.__new__(type(self.attributes))
            saved.__dict__.update(self.attributes.__dict__)
        self._saved.append(OpenBlock(kind, saved, self.names.mark()))

    def _end(self, kind: str, directive: Directive) -> None:
        self._cross(kind, directive)
        if not self._saved or self._saved[-1].kind != kind:
            found = f"{self._saved[-1].kind}Begin" if self._saved else "none"
            raise SceneError(f"{directive.place}: {kind}End: expected a {kind}Begin before it, got {found}")
        self.transforms.pop()
        block = self._saved.pop()
        if block.attributes is not None:
            self.attributes = block.attributes
            self.names.forget(block.names)

    def _cross(self, kind: str, directive: Directive) -> None:
        """Handles overlapping blocks of attributes and objects: the inner one ends, whatever its kind, as in PBRT."""
        inner = self._saved[-1] if self._saved else None
        if kind == "Transform" or inner is None or inner.kind in (kind, "Transform"):
            return
        other = next((block for block in reversed(self._saved) if block.kind == kind), None)
        if other is not None:
            self.report.add(str(directive.place), f"{kind}End inside {inner.kind}Begin", "the end of the inner block")
            inner.kind, other.kind = other.kind, inner.kind

    def left_over(self, parameters: Parameters, what: str) -> None:
        """Reports unused parameters."""
        for name in parameters.unasked():
            self.report.add(str(parameters.place), f"{what}: parameter {name!r}", picture=name not in HINTS)


def word(directive: Directive, at: int = 0) -> str:
    """A string value of a directive.

    Raises:
        SceneError: there is no string at this position.
    """
    found = directive.values[at] if at < len(directive.values) else None
    if not isinstance(found, tuple) or len(found) != 1:
        raise SceneError(f"{directive.place}: {directive.name}: expected a string")
    return found[0]


def numbers(directive: Directive, count: int) -> list[float]:
    """The numbers of a directive, bracketed or not.

    Raises:
        SceneError: there are strings, or a different count of numbers.
    """
    found: list[float] = []
    for value in directive.values:
        if isinstance(value, tuple):
            raise SceneError(f"{directive.place}: {directive.name}: expected {count} numbers, got {value!s:.40}")
        found.extend(value.tolist())
    if len(found) != count:
        raise SceneError(f"{directive.place}: {directive.name}: expected {count} numbers, got {len(found)}")
    return found


def matrix(directive: Directive) -> Matrix:
    """A matrix of sixteen numbers, column by column."""
    return np.array(numbers(directive, 16)).reshape(4, 4).T.copy()


def checked(directive: Directive, found: Matrix) -> Matrix:
    """The transform, if it is invertible.

    Raises:
        SceneError: it is not invertible.
    """
    plain = affine(found)
    if plain is None or not invertible(plain):
        raise SceneError(
            f"{directive.place}: {directive.name}: expected a matrix that can be inverted, last row 0 0 0 1"
        )
    return plain


def typed(directive: Directive) -> tuple[str, Parameters]:
    """Kind of a directive and its parameters."""
    return word(directive), parameters_of(directive, 1)
