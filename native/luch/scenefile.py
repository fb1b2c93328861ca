"""Scene files: one ``.luch`` holds one scene, in a zip of a JSON header and ``.npy`` arrays.

The header mirrors the dataclasses of :mod:`luch.scene` field by field, so that a new field needs no change
here: files written before it take its default. The operations of shader programs are stored with their names
(:mod:`luch.operations`). Nothing in a file is ever executed (no pickles).
"""

from __future__ import annotations

import dataclasses
import io
import json
import math
import os
import tokenize
import types
import typing
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from luch import scene as scene_module
from luch.operations import Signature, renumber, signatures
from luch.scene import Program, Scene

FORMAT = "luch scene"
# Raised when a file of the new kind would be misread by the old reader, or one of the old kind by the new.
VERSION = 2
OLDEST = 2  # version 1 did not name the operations of its shader programs
HEADER = "scene.json"
# What zipfile and json raise for bytes that make no sense to them. NotImplementedError: packed in a way that zipfile does
# not know; RuntimeError: encrypted, nested too deep; OSError: told to read before the beginning.
_BROKEN_ARCHIVE = (
    zipfile.BadZipFile, zlib.error, KeyError, ValueError, EOFError, NotImplementedError, RuntimeError, OverflowError,
    OSError,
)  # fmt: skip


class SceneFileError(ValueError):
    """A file that is not a scene, or not a whole one. The message names the file, the fact and the remedy."""


def write_scene(scene: Scene, path: str | os.PathLike[str]) -> None:
    """Writes a scene. The file appears whole or not at all.

    Raises OSError if it cannot be written, TypeError if a field holds what its annotation does not allow.
    """
    target = Path(path)
    partial = target.with_name(target.name + ".part")
    try:
        with zipfile.ZipFile(partial, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
            encoder = _Encoder(archive)
            body = encoder.encode(scene, "Scene")
            header = {"format": FORMAT, "version": VERSION, "operations": signatures(), "scene": body}
            archive.writestr(HEADER, json.dumps(header, ensure_ascii=False, indent=1))
        os.replace(partial, target)
    finally:
        partial.unlink(missing_ok=True)


def read_scene(path: str | os.PathLike[str]) -> Scene:
    """Reads a scene. Raises SceneFileError if the file is damaged or not a scene, OSError if it is not there."""
    name = os.fspath(path)
    with open(path, "rb") as stream:
        try:
            return _read(stream, name)
        except SceneFileError:
            raise
        except _Damage as damage:
            raise SceneFileError(f"{name}: {damage}. Export the scene again.") from damage
        except _BROKEN_ARCHIVE as error:
            raise SceneFileError(
                f"{name}: this is not a whole .luch file ({error}). Export the scene again."
            ) from error


def _read(stream: typing.BinaryIO, name: str) -> Scene:
    with zipfile.ZipFile(stream) as archive:
        for info in archive.infolist():  # others unpack without bound
            if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
                raise _Damage(f"{info.filename} is packed in a way that Luch does not use")
        header = json.loads(archive.read(HEADER))
        _check_header(header, name)
        decoder = _Decoder(archive)
        scene = decoder.decode(header["scene"], Scene, "Scene")
        _renumber(decoder.programs, header.get("operations"))
    assert isinstance(scene, Scene)
    return scene


def _check_header(header: Any, name: str) -> None:
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise SceneFileError(f"{name}: this zip holds no Luch scene. Choose a file that Luch exported.")
    version = header.get("version")
    if not isinstance(version, int) or version < 1:
        raise SceneFileError(f"{name}: its version {version!r} means nothing. Export the scene again.")
    if version > VERSION:
        raise SceneFileError(
            f"{name}: written in version {version} of the format, this Luch reads up to {VERSION}. Update Luch."
        )
    if version < OLDEST:
        raise SceneFileError(
            f"{name}: written in version {version} of the format, this Luch reads from {OLDEST} on. "
            "Export the scene again."
        )


def _renumber(programs: list[Program], table: Any) -> None:
    stored = [_signature(row, f"operations[{i}]") for i, row in enumerate(_expect(table, list, "operations"))]
    if stored == signatures():
        return
    for program in programs:
        try:
            program.code = renumber(program.code, stored)
        except ValueError as error:
            raise _Damage(str(error)) from error


def _signature(row: Any, where: str) -> Signature:
    if len(_expect(row, list, where)) != 4:
        raise _Damage(f"{where} has {len(row)} items, not 4")
    name, inputs, outputs, params = row
    counts = [_expect(count, int, where) for count in (inputs, outputs, params)]
    return _expect(name, str, where), counts[0], counts[1], counts[2]


class _Damage(ValueError):
    """A header that does not fit the dataclasses: where, and what."""


class _Encoder:
    """Values to JSON; arrays to members of the archive, one member for all uses of one array."""

    def __init__(self, archive: zipfile.ZipFile) -> None:
        self._archive = archive
        self._members: dict[int, str] = {}
        self._kept: list[NDArray[Any]] = []  # alive, so that no id is used twice

    def encode(self, value: Any, where: str) -> Any:
        if dataclasses.is_dataclass(value) and not isinstance(value, type):
            return {f.name: self.encode(getattr(value, f.name), f"{where}.{f.name}") for f in dataclasses.fields(value)}
        if isinstance(value, np.ndarray):
            return {"array": self._store(value, where)}
        if isinstance(value, dict):
            return {"map": [[key, self.encode(item, f"{where}[{key!r}]")] for key, item in value.items()]}
        if isinstance(value, list | tuple):
            return [self.encode(item, f"{where}[{i}]") for i, item in enumerate(value)]
        if isinstance(value, np.generic):
            value = value.item()
        if value is None or isinstance(value, bool | int | float | str):
            return value
        raise TypeError(f"{where} holds a {type(value).__name__}, which a scene file cannot keep")

    def _store(self, array: NDArray[Any], where: str) -> str:
        if array.dtype.hasobject:
            raise TypeError(f"{where} is an array of Python objects, which a scene file cannot keep")
        if id(array) not in self._members:
            member = f"arrays/{len(self._members)}.npy"
            buffer = io.BytesIO()
            np.lib.format.write_array(buffer, np.ascontiguousarray(array), allow_pickle=False)
            self._archive.writestr(member, buffer.getbuffer())
            self._members[id(array)] = member
            self._kept.append(array)
        return self._members[id(array)]


class _Decoder:
    """JSON to values, led by the annotations of the dataclasses."""

    def __init__(self, archive: zipfile.ZipFile) -> None:
        self._archive = archive
        self._arrays: dict[str, NDArray[Any]] = {}
        self.programs: list[Program] = []

    def decode(self, value: Any, hint: Any, where: str) -> Any:
        origin, arguments = typing.get_origin(hint), typing.get_args(hint)
        if origin in (types.UnionType, typing.Union):
            return self._decode_union(value, arguments, where)
        if _dtype(hint) is not None:
            return self._load(value, (hint,), where)
        if dataclasses.is_dataclass(hint) and isinstance(hint, type):
            return self._decode_dataclass(value, hint, where)
        if origin is list:
            items = _expect(value, list, where)
            return [self.decode(item, arguments[0], f"{where}[{i}]") for i, item in enumerate(items)]
        if origin is tuple:
            items = _expect(value, list, where)
            if len(items) != len(arguments):
                raise _Damage(f"{where} has {len(items)} items, not {len(arguments)}")
            pairs = zip(items, arguments, strict=True)
            return tuple(self.decode(item, kind, f"{where}[{i}]") for i, (item, kind) in enumerate(pairs))
        if origin is dict:
            pairs = _expect(_expect(value, dict, where).get("map"), list, where)
            if not all(isinstance(pair, list) and len(pair) == 2 and isinstance(pair[0], str) for pair in pairs):
                raise _Damage(f"{where} holds something else than pairs of a name and a value")
            return {key: self.decode(item, arguments[1], f"{where}[{key!r}]") for key, item in pairs}
        if hint is float and isinstance(value, int) and not isinstance(value, bool):
            return float(value)
        return _expect(value, hint, where)

    def _decode_union(self, value: Any, members: tuple[Any, ...], where: str) -> Any:
        if value is None and type(None) in members:
            return None
        rest = [member for member in members if member is not type(None)]
        if all(_dtype(member) is not None for member in rest):
            return self._load(value, tuple(rest), where)
        if len(rest) != 1:
            raise TypeError(f"{where}: a union of several kinds cannot be read back")
        return self.decode(value, rest[0], where)

    def _decode_dataclass(self, value: Any, kind: type, where: str) -> Any:
        given = _expect(value, dict, where)
        hints = _hints(kind)
        unknown = sorted(set(given) - set(hints))
        if unknown:
            raise _Damage(f"{where} has a field {unknown[0]!r} that this version does not know")
        values = {name: self.decode(item, hints[name], f"{where}.{name}") for name, item in given.items()}
        try:
            result = kind(**values)
        except TypeError as error:  # a field without default is missing
            raise _Damage(f"{where}: {error}") from error
        if isinstance(result, Program):
            self.programs.append(result)
        return result

    def _load(self, value: Any, allowed: tuple[Any, ...], where: str) -> NDArray[Any]:
        member = _expect(_expect(value, dict, where).get("array"), str, where)
        if member not in self._arrays:
            try:
                self._arrays[member] = _array(self._archive.read(member))
            except KeyError as error:
                raise _Damage(f"{where}: {member} is missing from the file") from error
            except _NO_ARRAY as error:
                raise _Damage(f"{where}: {member} is not an array ({error})") from error
        array = self._arrays[member]
        dtypes = [_dtype(hint) for hint in allowed]
        if array.dtype not in dtypes:
            expected = " or ".join(str(dtype) for dtype in dtypes)
            raise _Damage(f"{where} holds {array.dtype} numbers, not {expected}")
        return array


# What numpy raises for a header that is none: it reads it as Python's source.
_NO_ARRAY = (ValueError, TypeError, SyntaxError, OverflowError, MemoryError, RecursionError, tokenize.TokenError)


def _array(data: bytes) -> NDArray[Any]:
    """The array of a .npy member, if its header speaks of exactly as many bytes as there are."""
    stream = io.BytesIO(data)
    version = np.lib.format.read_magic(stream)
    if version != (1, 0):
        raise ValueError(f"version {version}")
    shape, fortran_order, dtype = np.lib.format.read_array_header_1_0(stream)
    announced, there = math.prod(shape) * dtype.itemsize, len(data) - stream.tell()
    if dtype.hasobject or min(shape, default=0) < 0 or announced != there:
        raise ValueError(f"{announced} bytes of {dtype} are announced, {there} are there")
    flat = np.frombuffer(data, dtype, offset=stream.tell()).copy()
    return flat.reshape(shape, order="F" if fortran_order else "C")


def _hints(kind: type) -> dict[str, Any]:
    """Field names of a dataclass and what they may hold."""
    hints = typing.get_type_hints(kind, vars(scene_module))
    return {f.name: hints[f.name] for f in dataclasses.fields(kind)}


def _dtype(hint: Any) -> np.dtype[Any] | None:
    """The number type of an NDArray annotation; None for any other annotation."""
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin is np.ndarray:  # numpy before 2.5 writes the alias out
        arguments = typing.get_args(arguments[1])
    elif origin is not NDArray:
        return None
    dtype: np.dtype[Any] = np.dtype(arguments[0])
    return dtype


def _expect(value: Any, kind: Any, where: str) -> Any:
    wrong_bool = isinstance(value, bool) and kind is not bool  # True is an int to Python, not to us
    if not isinstance(value, kind) or wrong_bool:
        raise _Damage(f"{where} holds {type(value).__name__}, not {kind.__name__}")
    return value
