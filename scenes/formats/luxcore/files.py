"""The files to which LuxCore's files refer, whose names are relative to the folder in which LuxCore was started."""

from __future__ import annotations

from pathlib import Path

from scenes.formats.text.scene_files import SceneFiles


class LuxCoreFiles(SceneFiles):
    """The files of one scene: a name is searched in the folders above that of the main file, too, and only the files
    inside of the root are found there."""

    def _found(self, name: str, where: str, beside: Path | None) -> Path | None:
        found = super()._found(name, where, beside)
        if found is not None:
            return found
        for above in self.folder.parents:
            path = (above / name.replace("\\", "/")).resolve()
            if path.is_relative_to(self.root) and path.is_file():
                return path
        return None
