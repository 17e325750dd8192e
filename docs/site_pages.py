"""Pages of the site that are made from other files: the reference, a page for each module, notation and changelog.

MkDocs calls the functions below as hooks.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("tsar", "renderer", "scenes", "analysis")
COPIES = {"notation.md": "NOTATION.md", "changelog.md": "CHANGELOG.md", "contributing.md": "CONTRIBUTING.md"}


def module_pages() -> dict[str, str]:
    """Address of the page of each module by its dotted name, in alphabetical order, packages before their modules."""
    found: dict[str, str] = {}
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py"), key=lambda path: path.with_suffix("").parts):
            parts = path.relative_to(ROOT).with_suffix("").parts
            name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
            page = "/".join((*parts[:-1], "index")) if parts[-1] == "__init__" else "/".join(parts)
            found[name] = f"reference/{page}.md"
    return dict(sorted(found.items(), key=lambda item: item[0].split(".")))


def reference_nav(pages: dict[str, str]) -> list[Any]:
    """The tree of packages and modules as MkDocs wants it."""
    tree: list[Any] = ["reference/index.md"]
    lists: dict[str, list[Any]] = {}
    for name, page in pages.items():
        parent, _, last = name.rpartition(".")
        siblings = lists[parent] if parent else tree
        if page.endswith("/index.md"):
            lists[name] = [page]
            siblings.append({last: lists[name]})
        else:
            siblings.append({last: page})
    return tree


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Adds the reference to the navigation."""
    config.nav = [*(config.nav or []), {"Reference": reference_nav(module_pages())}]
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Adds the pages."""
    pages = module_pages()
    for name, page in pages.items():
        files.append(File.generated(config, page, content=f"# {name.rpartition('.')[2]}\n\n::: {name}\n"))
    listed = "".join(f"- [{name}]({pages[name].removeprefix('reference/')})\n" for name in PACKAGES)
    files.append(File.generated(config, "reference/index.md", content=f"# Reference\n\n{listed}"))
    for page, source in COPIES.items():
        files.append(File.generated(config, page, content=(ROOT / source).read_text(encoding="utf-8")))
    return files


def on_page_content(html: str, **_: Any) -> str:
    """Drops the roles before names in docstrings (``:func:`` and the like)."""
    return re.sub(r":(?:func|class|mod|data|meth|attr):(?=<code>)", "", html)
