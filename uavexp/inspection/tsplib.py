"""TSPLIB files of symmetric tours: distances of every kind of its symmetric instances (Reinelt 1995)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.distance import cdist

from uavexp.arrays import Float
from uavexp.errors import UavexpError

MAX_NODES = 8000  # the matrix of distances is held whole: 512 MB
_EARTH_KM = 6378.388  # radius, and pi to the digits below: what the published optima were computed with
_PI = 3.141592
_EXPLICIT = "EXPLICIT"
_FULL = "FULL_MATRIX"
_TRIANGLES = {  # of the matrix, in the order of the file: is it the lower one by rows, has it a diagonal
    "UPPER_ROW": (False, False),
    "LOWER_ROW": (True, False),
    "UPPER_DIAG_ROW": (False, True),
    "LOWER_DIAG_ROW": (True, True),
    "UPPER_COL": (True, False),  # a column of the one triangle is a row of the other
    "LOWER_COL": (False, False),
    "UPPER_DIAG_COL": (True, True),
    "LOWER_DIAG_COL": (False, True),
}


class TsplibError(UavexpError):
    """A TSPLIB file is missing, damaged, or of a kind that is not read here."""


@dataclass(frozen=True, slots=True)
class _Parts:
    """What a file holds: its entries, `KEY : VALUE`, and the words of each section, by name."""

    entries: dict[str, str]
    sections: dict[str, list[str]]

    def choice(self, path: Path, key: str, allowed: list[str]) -> str:
        """The value of an entry that must be one of a few."""
        value = self.entries.get(key, "")
        if value not in allowed:
            raise TsplibError(f"{path}: {key} must be one of {', '.join(allowed)}, got {value or 'none'}")
        return value


def read(path: Path) -> Float:
    """Distances (N, N) of a TSPLIB file, symmetric with zeros on the diagonal.

    Args:
        path: file with EDGE_WEIGHT_TYPE EUC_2D, CEIL_2D, ATT, GEO or, in any EDGE_WEIGHT_FORMAT, EXPLICIT.

    Raises:
        TsplibError: in one line.
    """
    parts = _split(path)
    if parts.entries.get("TYPE", "TSP").split()[:1] != ["TSP"]:
        raise TsplibError(f"{path}: TYPE must be TSP, got {parts.entries['TYPE'] or 'none'}")
    if "FIXED_EDGES_SECTION" in parts.sections:
        raise TsplibError(f"{path}: FIXED_EDGES_SECTION is not read: no tour is made to hold given edges")
    kind = parts.choice(path, "EDGE_WEIGHT_TYPE", [*_DISTANCES, _EXPLICIT])
    dimension = parts.entries.get("DIMENSION", "")
    if not (dimension.isdecimal() and len(dimension) < 9 and 1 <= int(dimension) <= MAX_NODES):
        raise TsplibError(f"{path}: DIMENSION must be 1 to {MAX_NODES}, got {dimension[:40] or 'none'}")
    if kind == _EXPLICIT:
        return _explicit(path, parts, int(dimension))
    node = _numbers(path, parts, "NODE_COORD_SECTION", 3 * int(dimension)).reshape(-1, 3)[:, 1:]
    return _DISTANCES[kind](node)


def _split(path: Path) -> _Parts:
    """Take a file apart."""
    if not path.is_file():
        raise TsplibError(f"{path} does not exist")
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except UnicodeDecodeError as error:
        raise TsplibError(f"{path} is no text file") from error
    except OSError as error:
        raise TsplibError(f"{path} cannot be read: {error}") from error
    parts = _Parts(entries={}, sections={})
    section: list[str] = []
    for line in lines:
        key, colon, value = (word.strip() for word in line.partition(":"))
        name = key.upper()
        if name == "EOF":
            break
        if name.endswith("_SECTION"):
            section = parts.sections.setdefault(name, [])
        elif colon:
            parts.entries[name] = value
        else:
            section.extend(line.split())
    return parts


def _numbers(path: Path, parts: _Parts, section: str, count: int) -> Float:
    """The numbers of a section, which must be so many."""
    words = parts.sections.get(section, [])
    if len(words) != count:
        raise TsplibError(f"{path}: {section} must hold {count} numbers, got {len(words)}")
    try:
        values = np.array(words, dtype=np.float64)
    except ValueError as error:
        raise TsplibError(f"{path}: {section} must hold numbers: {error}") from error
    if not np.isfinite(values).all():
        raise TsplibError(f"{path}: {section} must hold finite numbers")
    return values


def _explicit(path: Path, parts: _Parts, nodes: int) -> Float:
    """Distances written out."""
    section = "EDGE_WEIGHT_SECTION"
    form = parts.choice(path, "EDGE_WEIGHT_FORMAT", [_FULL, *_TRIANGLES])
    if form == _FULL:
        apart = _numbers(path, parts, section, nodes * nodes).reshape(nodes, nodes)
        if not np.array_equal(apart, apart.T):
            raise TsplibError(f"{path}: {_FULL} must be symmetric: there and back are of one length")
    else:
        is_lower, has_diagonal = _TRIANGLES[form]
        inside = (np.tril if is_lower else np.triu)(np.ones((nodes, nodes), dtype=np.bool_))
        if not has_diagonal:
            np.fill_diagonal(inside, False)
        apart = np.zeros((nodes, nodes))
        apart[inside] = _numbers(path, parts, section, int(inside.sum()))
        apart += apart.T
    np.fill_diagonal(apart, 0.0)
    return apart


def _rounded(node: Float) -> Float:
    """Euclidean distances to the nearest whole number."""
    return np.asarray(np.floor(cdist(node, node) + 0.5))


def _ceiling(node: Float) -> Float:
    """Euclidean distances rounded up."""
    return np.asarray(np.ceil(cdist(node, node)))


def _pseudo_euclidean(node: Float) -> Float:
    """Distances of att48 and att532: Euclidean ones over the root of ten, rounded up."""
    return np.asarray(np.ceil(np.sqrt(cdist(node, node, "sqeuclidean") / 10.0)))


def _geographic(node: Float) -> Float:
    """Distances in km on the idealised earth; coordinates are degrees and minutes, DDD.MM."""
    degrees = np.trunc(node)
    radians = _PI * (degrees + 5.0 * (node - degrees) / 3.0) / 180.0
    latitude, longitude = radians.T
    q1 = np.cos(longitude[:, None] - longitude[None])
    q2 = np.cos(latitude[:, None] - latitude[None])
    q3 = np.cos(latitude[:, None] + latitude[None])
    angle = np.arccos(np.clip(0.5 * ((1.0 + q1) * q2 - (1.0 - q1) * q3), -1.0, 1.0))
    apart: Float = np.trunc(_EARTH_KM * angle + 1.0)
    np.fill_diagonal(apart, 0.0)
    return apart


_DISTANCES: dict[str, Callable[[Float], Float]] = {
    "EUC_2D": _rounded,
    "CEIL_2D": _ceiling,
    "ATT": _pseudo_euclidean,
    "GEO": _geographic,
}
