"""Cryptomatte's metadata: which name hides behind which value (Friedman and Jones 2015, specification 1.2)."""

from __future__ import annotations

import json
from collections.abc import Iterable

from luch.scene import Scene

MASK = 0xFFFFFFFF


def metadata(scene: Scene, layer: str) -> dict[str, str]:
    """Header fields of every cryptomatte in the film's passes. layer: name of the view layer."""
    fields: dict[str, str] = {}
    for kind in ("Object", "Material", "Asset"):
        if f"Crypto{kind}00" not in scene.film.passes:
            continue
        name = f"{layer}.Crypto{kind}"
        prefix = f"cryptomatte/{murmur3(name):08x}"[:19]  # "cryptomatte/" and seven digits
        fields[f"{prefix}/name"] = name
        fields[f"{prefix}/hash"] = "MurmurHash3_32"
        fields[f"{prefix}/conversion"] = "uint32_to_float32"
        fields[f"{prefix}/manifest"] = manifest(_names(scene, kind))
    return fields


def manifest(names: Iterable[str]) -> str:
    """JSON that maps names to the eight hexadecimal digits of their float's bits."""
    return json.dumps({name: f"{float_bits(murmur3(name)):08x}" for name in sorted(set(names))}, ensure_ascii=False)


def murmur3(text: str, seed: int = 0) -> int:
    """MurmurHash3 x86 32 (Austin Appleby, public domain) of the UTF-8 bytes."""
    data = text.encode()
    value = seed
    whole = len(data) // 4 * 4
    for start in range(0, whole, 4):
        value ^= _scramble(int.from_bytes(data[start : start + 4], "little"))
        value = (_rotate(value, 13) * 5 + 0xE6546B64) & MASK
    if whole < len(data):
        value ^= _scramble(int.from_bytes(data[whole:], "little"))
    value ^= len(data)
    value = ((value ^ (value >> 16)) * 0x85EBCA6B) & MASK
    value = ((value ^ (value >> 13)) * 0xC2B2AE35) & MASK
    return value ^ (value >> 16)


def float_bits(value: int) -> int:
    """The hash as bits of a float that is neither denormal, infinite nor NaN (exponents 0 and 255 lose a bit)."""
    exponent = (value >> 23) & 0xFF
    return value ^ (1 << 23) if exponent in (0, 255) else value


def _names(scene: Scene, kind: str) -> list[str]:
    if kind == "Material":
        return [material.name for material in scene.materials]
    return [subject.asset if kind == "Asset" else subject.name for subject in scene.objects]


def _scramble(block: int) -> int:
    return (_rotate((block * 0xCC9E2D51) & MASK, 15) * 0x1B873593) & MASK


def _rotate(value: int, bits: int) -> int:
    return ((value << bits) | (value >> (32 - bits))) & MASK
