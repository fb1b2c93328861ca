"""Cryptomatte ids: MurmurHash3 of a name as a float (Friedman & Jones, Cryptomatte specification 1.2)."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterable

from luch.scene import Scene


def _rotate(x: int, bits: int) -> int:
    return ((x << bits) | (x >> (32 - bits))) & 0xFFFFFFFF


def murmur3_32(data: bytes, seed: int = 0) -> int:
    """32-bit MurmurHash3 (Appleby, public domain) of bytes."""
    h = seed
    whole = len(data) // 4 * 4
    for (k,) in struct.iter_unpack("<I", data[:whole]):
        h ^= _rotate(k * 0xCC9E2D51 & 0xFFFFFFFF, 15) * 0x1B873593 & 0xFFFFFFFF
        h = (_rotate(h, 13) * 5 + 0xE6546B64) & 0xFFFFFFFF
    tail = int.from_bytes(data[whole:], "little")
    if data[whole:]:
        h ^= _rotate(tail * 0xCC9E2D51 & 0xFFFFFFFF, 15) * 0x1B873593 & 0xFFFFFFFF
    h ^= len(data)
    h = (h ^ (h >> 16)) * 0x85EBCA6B & 0xFFFFFFFF
    h = (h ^ (h >> 13)) * 0xC2B2AE35 & 0xFFFFFFFF
    return h ^ (h >> 16)


def name_to_hash(name: str) -> int:
    """The 32 bits that stand for a name; exponents that would make infinities or denormals are moved."""
    bits = murmur3_32(name.encode("utf-8"))
    exponent = bits >> 23 & 0xFF
    return bits ^ (1 << 23) if exponent in (0, 255) else bits


def name_to_id(name: str) -> float:
    """The id as pixels hold it: float32."""
    return float(struct.unpack("<f", struct.pack("<I", name_to_hash(name)))[0])


def manifest(names: Iterable[str]) -> str:
    """JSON that maps names to eight hex digits, as a compositor reads it."""
    return json.dumps({name: f"{name_to_hash(name):08x}" for name in sorted(set(names))}, ensure_ascii=False)


def metadata(scene: Scene, layer: str) -> dict[str, str]:
    """EXR header fields of every cryptomatte among the film's passes. layer: name of the view layer."""
    fields: dict[str, str] = {}
    for kind in ("Object", "Material", "Asset"):
        if f"Crypto{kind}00" not in scene.film.passes:
            continue
        title = f"{layer}.Crypto{kind}"
        prefix = f"cryptomatte/{murmur3_32(title.encode()):08x}"[:-1]  # seven digits
        fields[f"{prefix}/name"] = title
        fields[f"{prefix}/hash"] = "MurmurHash3_32"
        fields[f"{prefix}/conversion"] = "uint32_to_float32"
        fields[f"{prefix}/manifest"] = manifest(_names(scene, kind))
    return fields


def _names(scene: Scene, kind: str) -> list[str]:
    if kind == "Material":
        return [material.name for material in scene.materials]
    return [subject.asset if kind == "Asset" else subject.name for subject in scene.objects]
