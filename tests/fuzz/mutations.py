"""Damage: one field of a scene set to something hostile, led by the dataclasses alone, so that new fields are damaged
too; and the bytes of a file flipped, cut or repeated."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from luch.scene import Program, Scene

from fuzz.values import Rng, chance, hostile, hostile_count

# More samples, time or threads are no damage, and files name no devices that may be absent here.
LEFT_ALONE = {"samples", "time_limit", "error_limit", "verify", "device", "gpus", "samples_in_all"}
WORDS = ("", "NONE", "AUTO", "POINT", "nothing", "Combined", "Mesh 0", "CryptoObject00", "é\n", "x" * 300)


@dataclasses.dataclass
class Place:
    """Where a value stands: owner[key] or owner.key."""

    owner: Any
    key: Any
    path: str

    @property
    def value(self) -> Any:
        return (
            getattr(self.owner, self.key)
            if isinstance(self.key, str) and not isinstance(self.owner, dict)
            else self.owner[self.key]
        )

    def set(self, value: Any) -> None:
        if isinstance(self.key, str) and not isinstance(self.owner, dict):
            setattr(self.owner, self.key, value)
        else:
            self.owner[self.key] = value


def places(value: Any, path: str) -> list[Place]:
    """Every field and item below a value that can be set anew."""
    found: list[Place] = []
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        found = [
            Place(value, f.name, f"{path}.{f.name}") for f in dataclasses.fields(value) if f.name not in LEFT_ALONE
        ]
    elif isinstance(value, list):
        found = [Place(value, k, f"{path}[{k}]") for k in range(len(value))]
    elif isinstance(value, dict):
        found = [Place(value, key, f"{path}[{key!r}]") for key in value]
    return found + [below for place in found for below in places(place.value, place.path)]


def damage(scene: Scene, rng: Rng) -> list[str]:
    """Damages one to three places of a scene; says what was done."""
    done = []
    for _ in range(int(rng.integers(1, 4))):
        every = places(scene, "Scene")
        if chance(rng, 0.3):
            every = [place for place in every if isinstance(place.owner, Program)] or every
        place = every[int(rng.integers(len(every)))]
        told = _damage_value(place, rng)
        if told:
            done.append(f"{place.path}: {told}")
    return done


def _damage_value(place: Place, rng: Rng) -> str:
    value = place.value
    if isinstance(value, bool):
        place.set(not value)
    elif isinstance(value, int):
        place.set(hostile_count(rng))
    elif isinstance(value, float):
        place.set(hostile(rng))
    elif isinstance(value, str):
        place.set(WORDS[int(rng.integers(len(WORDS)))])
    elif isinstance(value, tuple) and value:
        items, k = list(value), int(rng.integers(len(value)))
        items[k] = (
            hostile_count(rng) if isinstance(items[k], int) else hostile(rng) if isinstance(items[k], float) else "?"
        )
        place.set(tuple(items))
    elif isinstance(value, np.ndarray):
        return _damage_array(place, value.copy(), rng)
    elif isinstance(value, list) and value:
        _damage_list(value, rng)
    elif (
        dataclasses.is_dataclass(value)
        and chance(rng, 0.2)
        and place.key in ("instances", "world", "volume", "motion", "shutter")
    ):
        place.set(None)
    else:
        return ""
    return f"now {place.value!r}"[:200]


def _damage_list(value: list[Any], rng: Rng) -> None:
    k = int(rng.integers(len(value)))
    if chance(rng, 0.5):
        del value[k:]
    elif chance(rng, 0.5):
        value.append(value[k])
    else:
        del value[k]


def _damage_array(place: Place, array: np.ndarray[Any, Any], rng: Rng) -> str:
    kind = int(rng.integers(6))
    if kind < 3 and array.size:  # numbers
        for _ in range(int(rng.integers(1, 4))):
            at = int(rng.integers(array.size))
            if array.dtype.kind == "f":
                with np.errstate(over="ignore"):
                    array.reshape(-1)[at] = hostile(rng)
            else:
                array.reshape(-1)[at] = hostile_count(rng) & int(np.iinfo(array.dtype).max)
        told = "numbers"
    elif kind == 3:  # rows
        array = array[: int(rng.integers(len(array) + 1))] if array.ndim else array
        told = f"cut to {array.shape}"
    elif kind == 4:
        array = np.concatenate([array, array])
        told = f"doubled to {array.shape}"
    else:
        shapes = (array.reshape(-1), array[..., None], array[:0], array.reshape(-1)[: array.size // 2], array[None])
        array = shapes[int(rng.integers(len(shapes)))]
        told = f"shape {array.shape}"
    place.set(np.ascontiguousarray(array))
    return told


def damage_bytes(data: bytes, rng: Rng) -> bytes:
    """A file some of whose bytes are wrong, missing, or there twice."""
    kind = int(rng.integers(5))
    if kind == 0:
        return data[: int(rng.integers(len(data)))]
    broken = bytearray(data)
    if kind == 1:
        at, size = int(rng.integers(len(data))), int(rng.integers(1, 64))
        broken[at : at + size] = rng.bytes(size)
    elif kind == 2:
        at, size = int(rng.integers(len(data))), int(rng.integers(1, 4096))
        broken[at:at] = broken[at : at + size]
    else:  # the directory at the end steers the reader: damaged as often as all the rest
        first = 0 if kind == 3 else max(0, len(data) - 600)
        for _ in range(int(rng.integers(1, 9))):
            broken[int(rng.integers(first, len(data)))] ^= 1 << int(rng.integers(8))
    return bytes(broken)
