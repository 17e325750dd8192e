"""XML documents as plain trees with places; entities, document types and external references are rejected."""

from __future__ import annotations

import codecs
import io
import re
import xml.etree.ElementTree as ElementTree
import xml.sax
from dataclasses import dataclass, field
from typing import Any
from xml.sax.saxutils import quoteattr

from scenes.canonical import SceneError
from scenes.formats.text.places import TextPosition

DEPTH_MAX = 64
NODES_MAX = 2_000_000

_SPECIAL = re.compile(r'[&<>"\r\n\t]')


@dataclass
class XmlNode:
    """An element: its tag, attributes, children, and its place."""

    tag: str
    attributes: dict[str, str]
    place: TextPosition
    children: list[XmlNode] = field(default_factory=list)

    def get(self, name: str, default: str = "") -> str:
        """An attribute."""
        return self.attributes.get(name, default)


class _Builder(xml.sax.ContentHandler):
    def __init__(self, file: str) -> None:
        super().__init__()
        self.file, self.open, self.count = file, [], 0
        self.root: XmlNode | None = None
        self.locator: Any = None

    def setDocumentLocator(self, locator: Any) -> None:
        self.locator = locator

    def startElement(self, name: str, attrs: Any) -> None:
        place = TextPosition(self.file, self.locator.getLineNumber(), self.locator.getColumnNumber() + 1)
        node = XmlNode(name, dict(attrs.items()), place)
        self.count += 1
        if len(self.open) >= DEPTH_MAX or self.count > NODES_MAX:
            raise SceneError(
                f"{place}: expected at most {DEPTH_MAX} elements inside each other and {NODES_MAX:,} in all"
            )
        if self.open:
            self.open[-1].children.append(node)
        else:
            self.root = node
        self.open.append(node)

    def endElement(self, name: str) -> None:
        self.open.pop()


def xml_text(root: ElementTree.Element) -> str:
    """A document with an element a line, indented by tabs. Elements have attributes and children, and no text."""
    lines = ["<?xml version='1.0' encoding='utf-8'?>"]
    _write(root, "", lines)
    return "\n".join([*lines, ""])


def _write(element: ElementTree.Element, margin: str, lines: list[str]) -> None:
    named = "".join([f' {name}="{_escaped(value)}"' for name, value in element.items()])
    if not len(element):
        lines.append(f"{margin}<{element.tag}{named} />")
        return
    lines.append(f"{margin}<{element.tag}{named}>")
    for child in element:
        _write(child, margin + "\t", lines)
    lines.append(f"{margin}</{element.tag}>")


def _escaped(value: str) -> str:
    return quoteattr(value, {'"': "&quot;"})[1:-1] if _SPECIAL.search(value) else value


def parse_xml(content: bytes, file: str) -> XmlNode:
    """The tree of a document.

    Raises:
        SceneError: the document is not well-formed, or declares entities or a document type; the message gives file,
            line and column.
    """
    import defusedxml
    import defusedxml.expatreader

    builder = _Builder(file)
    if not content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) and b"encoding" not in content[:200]:
        try:
            content.decode("utf-8")
        except UnicodeDecodeError:  # undeclared, so mostly Latin-1
            content = content.decode("latin-1").encode()
    parser = defusedxml.expatreader.create_parser(forbid_dtd=True)
    parser.setContentHandler(builder)
    try:
        parser.parse(io.BytesIO(content))
    except xml.sax.SAXParseException as error:
        place = TextPosition(file, error.getLineNumber() or 1, (error.getColumnNumber() or 0) + 1)
        raise SceneError(f"{place}: expected well-formed XML ({error.getMessage()})") from None
    except defusedxml.DefusedXmlException as error:
        raise SceneError(f"{file}: expected no document type and no entities, got {type(error).__name__}") from None
    except (ValueError, LookupError, UnicodeError) as error:
        if isinstance(error, SceneError):
            raise
        raise SceneError(f"{file}: expected XML ({' '.join(str(error).split())[:100]})") from None
    if builder.root is None:
        raise SceneError(f"{file}: expected an XML document, got none")
    return builder.root
