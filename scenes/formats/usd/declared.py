"""Declaration of the USD format, whose package is needed only where a file is read or written."""

from scenes.canonical import Scene
from scenes.formats.losses import LossReport
from scenes.formats.text.format import Format
from scenes.formats.text.output import Output
from scenes.models import USD_ENDINGS
from scenes.models.for_conversion import load_model


def _save(scene: Scene, output: Output, report: LossReport) -> None:
    from scenes.formats.usd.write import save_usd  # needs the extra usd

    save_usd(scene, output, report)


USD = Format("USD", USD_ENDINGS, load_model, _save)
