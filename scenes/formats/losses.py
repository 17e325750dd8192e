"""What a conversion could not carry over: every loss is written down, once each, with what became of it."""

from __future__ import annotations

from dataclasses import asdict, dataclass

from scenes.canonical import SceneError


@dataclass(frozen=True)
class Loss:
    """Something that a format has and the next does not.

    Attributes:
        where: file and line, or the name of the part of the scene.
        what: that could not be kept.
        became: what stands in its place; ``left out`` where nothing does.
    """

    where: str
    what: str
    became: str

    def __str__(self) -> str:
        return f"{self.where}: {self.what}: {self.became}"


class LossReport:
    """Collects losses; the same one at the same place counts once."""

    def __init__(self) -> None:
        self._losses: dict[Loss, None] = {}

    def add(self, where: str, what: str, became: str = "left out") -> None:
        """Writes a loss down."""
        self._losses.setdefault(Loss(where, what, became))

    @property
    def losses(self) -> tuple[Loss, ...]:
        """All of them, in the order that they were met."""
        return tuple(self._losses)

    def rows(self) -> list[dict[str, str]]:
        """For JSON."""
        return [asdict(loss) for loss in self._losses]

    def text(self) -> str:
        """A line each."""
        return "\n".join(map(str, self._losses))

    def refuse_any(self) -> None:
        """Raises SceneError where something was lost."""
        if self._losses:
            rest = f" (and {len(self._losses) - 1} more)" if len(self._losses) > 1 else ""
            raise SceneError(f"expected a conversion without losses, got {next(iter(self._losses))}{rest}")
