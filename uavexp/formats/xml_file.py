"""XML files as trees without namespaces, whatever their encoding."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

from uavexp.errors import WorldError, one_line

MAX_DEPTH = 200  # of elements in elements


_NO_VALUE = re.compile(rb"(<\w[^<>]*?\s\w+)=(?=\s*/?>)")  # an attribute, which Gazebo's own parser lets pass


def parse(path: Path) -> ElementTree.Element:
    """Return the root of a file.

    Raises:
        WorldError: it is no whole XML, or declares a document type, whose entities can
            grow without bound or name other files.
    """
    text = path.read_bytes()
    try:
        try:
            return _root(path, text)
        except ElementTree.ParseError:
            return _root(path, _NO_VALUE.sub(rb'\1=""', text))
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise WorldError(f"world file {path} is damaged or truncated: no XML, {one_line(error)}") from error


def _root(path: Path, text: bytes) -> ElementTree.Element:
    parser = ElementTree.XMLParser(target=_Builder(path))
    parser.feed(text)
    root: ElementTree.Element = parser.close()
    return root


class _Builder(ElementTree.TreeBuilder):
    def __init__(self, path: Path) -> None:
        super().__init__()
        self._path = path
        self._depth = 0

    def start(self, tag: str, attributes: dict[str, str]) -> ElementTree.Element:
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise WorldError(f"world file {self._path} nests more than {MAX_DEPTH} elements")
        return super().start(tag.rpartition("}")[2], attributes)

    def end(self, tag: str) -> ElementTree.Element:
        self._depth -= 1
        return super().end(tag.rpartition("}")[2])

    def doctype(self, name: str, public: str | None, system: str | None) -> None:
        raise WorldError(f"world file {self._path} declares a document type; remove its <!DOCTYPE>")
