"""The comment behind a field (unit, shape, what it is) is its documentation."""

from __future__ import annotations

from typing import Any

from griffe import Attribute, Docstring, Extension


class Comments(Extension):
    """Takes a field's trailing comment for its docstring."""

    def on_attribute(self, *, attr: Attribute, **_: Any) -> None:
        """Look at one field."""
        if attr.docstring is None and attr.lineno is not None:
            line = attr.lines_collection[attr.filepath][attr.lineno - 1]
            _, mark, comment = line.partition("  # ")
            if mark:
                attr.docstring = Docstring(comment, lineno=attr.lineno, parent=attr)
