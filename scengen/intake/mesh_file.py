"""Vertices and polygons of mesh files.

trimesh reads STL and glTF, which hold triangles. Formats with polygons are read here: trimesh cuts a polygon from its
first corner, which is wrong if the polygon is not convex, and does not accept all that the formats allow.
"""

import logging
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from ..assets.mesh_prop import Points
from ..errors import cut
from .polygons import Polygons

OFF_HEADER = re.compile(rb"(ST)?C?N?OFF")
"""First word of an OFF file with three coordinates for each vertex; further numbers of a vertex follow them."""
PLY_TYPES = {
    **dict.fromkeys((b"char", b"int8"), "i1"),
    **dict.fromkeys((b"uchar", b"uint8"), "u1"),
    **dict.fromkeys((b"short", b"int16"), "i2"),
    **dict.fromkeys((b"ushort", b"uint16"), "u2"),
    **dict.fromkeys((b"int", b"int32"), "i4"),
    **dict.fromkeys((b"uint", b"uint32"), "u4"),
    **dict.fromkeys((b"float", b"float32"), "f4"),
    **dict.fromkeys((b"double", b"float64"), "f8"),
}
"""Numpy's names of the types in PLY files."""
PLY_ORDERS = {b"ascii": "", b"binary_little_endian": "<", b"binary_big_endian": ">"}
"""Byte orders of the formats of PLY files; empty for text."""
MAX_STL_NAME = 1000
"""Largest length of the first line of an STL file in text [bytes], after which its first triangle starts."""
PLY_CORNERS = ("vertex_indices", "vertex_index")
"""Names of the property that lists the corners of a polygon."""


def load(data: bytes, ending: str) -> tuple[Points, Polygons]:
    """Vertices and polygons of a mesh file, with the parts of a scene merged.

    Raises:
        Exception: the file is damaged; the type of the error depends on the format.
    """
    data = _whole_stl(data) if ending == "stl" else data
    readers: dict[str, Callable[[bytes], tuple[Points, Polygons]]] = {"obj": _obj, "off": _off, "ply": _ply}
    return readers[ending](data) if ending in readers else _by_trimesh(data, ending)


def _whole_stl(data: bytes) -> bytes:
    """A binary STL file without what follows its triangles; a text as it is.

    Raises:
        EOFError: it holds fewer triangles than it announces.
    """
    head, size = 84, 50  # of the header with the number of triangles, and of a triangle [bytes]
    count = int.from_bytes(data[80:head], "little")
    is_text = data.lstrip()[:5].lower() == b"solid" and b"facet" in data[:MAX_STL_NAME]
    if len(data) < head or (is_text and len(data) != head + size * count):
        return data
    if (whole := (len(data) - head) // size) < count:
        raise EOFError(f"it announces {count} triangles and holds {whole}")
    return data[: head + size * count]


def _by_trimesh(data: bytes, ending: str) -> tuple[Points, Polygons]:
    logging.getLogger("trimesh").setLevel(logging.CRITICAL)  # it logs problems to standard error
    found: Any = trimesh.load(
        trimesh.util.wrap_as_stream(data), file_type=ending, force="mesh", process=False, skip_materials=True
    )
    points = np.asarray(getattr(found, "vertices", np.zeros((0, 3))), np.float64)
    return points, Polygons.of(np.asarray(getattr(found, "faces", np.zeros((0, 3))), np.int64))


def _obj(data: bytes) -> tuple[Points, Polygons]:
    points: list[list[float]] = []
    polygons: list[list[int]] = []
    for number, line in enumerate(re.sub(rb"\\\r?\n", b"  ", data).splitlines(), 1):
        words = line.partition(b"#")[0].split()
        try:
            if words[:1] == [b"v"]:
                points.append(_coordinates(words[1:]))
            elif words[:1] == [b"f"]:
                corners = [int(word.partition(b"/")[0]) for word in words[1:]]
                if len(corners) < 3 or 0 in corners:
                    raise ValueError
                polygons.append([i - 1 if i > 0 else len(points) + i for i in corners])
        except ValueError:
            raise ValueError(f"line {number}: {_shown(line)}") from None
    return _points(points), Polygons.of(polygons)


def _off(data: bytes) -> tuple[Points, Polygons]:
    lines = ((n, words) for n, line in enumerate(data.splitlines(), 1) if (words := line.partition(b"#")[0].split()))
    number, words = next(lines, (1, [b""]))
    try:
        if not OFF_HEADER.fullmatch(words[0]):
            raise ValueError
        number, words = (number, words[1:]) if len(words) > 1 else _next(lines)
        vertices, faces = int(words[0]), int(words[1])
        points: list[list[float]] = []
        polygons: list[list[int]] = []
        for _ in range(vertices):
            number, words = _next(lines)
            points.append(_coordinates(words))
        for _ in range(faces):
            number, words = _next(lines)
            if (count := int(words[0])) < 3 or len(words) <= count:
                raise ValueError
            polygons.append([int(word) for word in words[1 : count + 1]])
    except (ValueError, IndexError):
        raise ValueError(f"line {number}: {_shown(b' '.join(words))}") from None
    return _points(points), Polygons.of(polygons)


def _next(lines: Iterator[tuple[int, list[bytes]]]) -> tuple[int, list[bytes]]:
    """Number and words of the next line.

    Raises:
        EOFError: the file ends here.
    """
    if (found := next(lines, None)) is None:
        raise EOFError("it ends too early")
    return found


def _coordinates(words: list[bytes]) -> list[float]:
    x, y, z = words[:3]
    return [float(x), float(y), float(z)]


def _points(found: list[list[float]]) -> Points:
    return np.array(found, np.float64).reshape(-1, 3)


def _shown(line: bytes) -> str:
    return repr(cut(line.decode("utf-8", "replace").strip(), 40))


# --- PLY --------------------------------------------------------------------------------------


@dataclass
class _Element:
    """A kind of things in a PLY file, such as vertices."""

    name: str
    count: int
    """Number of things."""
    properties: list[tuple[str, str, str]]
    """Name and type of each property, and the type of its length if it is a list."""


def _ply(data: bytes) -> tuple[Points, Polygons]:
    head, separator, body = data.partition(b"end_header")
    order, elements = _ply_header(head)
    if not separator:
        raise ValueError("its header does not end")
    body = body[body.find(b"\n") + 1 :]
    read = _binary_columns(body, order) if order else _text_columns(body)
    points, polygons = np.zeros((0, 3)), Polygons.of([])
    for element in elements:
        columns = read(element)
        if element.name == "vertex":
            if missing := {"x", "y", "z"} - set(columns):
                raise ValueError(f"its vertices have no {', '.join(sorted(missing))}")
            points = np.column_stack([np.asarray(columns[axis], np.float64) for axis in "xyz"])
        elif element.name == "face":
            polygons = Polygons.of(next((columns[name] for name in PLY_CORNERS if name in columns), []))
    return points, polygons


def _ply_header(head: bytes) -> tuple[str, list[_Element]]:
    """Byte order, empty for text, and the elements of a PLY file."""
    order, elements = None, list[_Element]()
    for number, line in enumerate(head.splitlines(), 1):
        try:
            match line.split():
                case [b"ply"] if number == 1:
                    pass
                case [b"format", name, _]:
                    order = PLY_ORDERS[name]
                case [b"element", name, count]:
                    elements.append(_Element(name.decode(), int(count), []))
                case [b"property", b"list", size, kind, name]:
                    elements[-1].properties.append((name.decode(), PLY_TYPES[kind], PLY_TYPES[size]))
                case [b"property", kind, name]:
                    elements[-1].properties.append((name.decode(), PLY_TYPES[kind], ""))
                case [b"comment" | b"obj_info", *_]:
                    pass
                case _:
                    raise ValueError
        except (ValueError, LookupError):
            raise ValueError(f"line {number}: {_shown(line)}") from None
    if order is None:
        raise ValueError("its header names no format")
    return order, elements


_Columns = dict[str, Any]
"""Values of each property of an element; those of a list property are lists."""


def _text_columns(body: bytes) -> Callable[[_Element], _Columns]:
    """A function that reads the next element of a text."""
    lines = ((n, words) for n, line in enumerate(body.splitlines(), 1) if (words := line.split()))

    def read(element: _Element) -> _Columns:
        columns: _Columns = {name: [] for name, _, _ in element.properties}
        for _ in range(element.count):
            number, words = _next(lines)
            rest = iter(words)
            try:
                for name, kind, size in element.properties:
                    value = float if kind[0] == "f" else int
                    found = [value(next(rest)) for _ in range(int(next(rest)) if size else 1)]
                    columns[name].append(found if size else found[0])
            except (ValueError, StopIteration):
                raise ValueError(f"line {number} below the header: {_shown(b' '.join(words))}") from None
        return columns

    return read


def _binary_columns(body: bytes, order: str) -> Callable[[_Element], _Columns]:
    """A function that reads the next element of bytes."""
    place = 0

    def take(kind: str, count: int) -> NDArray[Any]:
        nonlocal place
        dtype = np.dtype(order + kind)
        if count < 0 or place + count * dtype.itemsize > len(body):
            raise EOFError("it ends too early")
        found = np.frombuffer(body, dtype, count, place)
        place += count * dtype.itemsize
        return found

    def read(element: _Element) -> _Columns:
        nonlocal place
        start = place
        if not element.count:
            return {name: [] for name, _, _ in element.properties}
        rows: list[list[Any]] = []
        for i in range(element.count):
            row = [take(kind, int(take(size, 1)[0]) if size else 1) for _, kind, size in element.properties]
            rows.append([found if prop[2] else found[0] for found, prop in zip(row, element.properties, strict=True)])
            if i == 0 and (columns := uniform(element, [len(found) for found in row], start)) is not None:
                return columns
        return {name: [row[k] for row in rows] for k, (name, _, _) in enumerate(element.properties)}

    def uniform(element: _Element, lengths: list[int], start: int) -> _Columns | None:
        """All things at once, if their lists have the same lengths as those of the first one."""
        nonlocal place
        fields = [
            field
            for (name, kind, size), length in zip(element.properties, lengths, strict=True)
            for field in (
                [(f"{name} length", order + size), (name, order + kind, (length,))] if size else [(name, order + kind)]
            )
        ]
        dtype = np.dtype(fields)
        if start + element.count * dtype.itemsize > len(body):
            return None
        rows = np.frombuffer(body, dtype, element.count, start)
        for (name, _, size), length in zip(element.properties, lengths, strict=True):
            if size and not (rows[f"{name} length"] == length).all():
                return None
        place = start + element.count * dtype.itemsize
        return {name: rows[name] for name, _, _ in element.properties}

    return read
