"""Random numbers that Blender users know from Cycles: of names and of indices."""

from __future__ import annotations


def random_of(number: int) -> float:
    """0..1 of an index: Bob Jenkins' final mix, as Cycles numbers particles."""
    return _mix(number) / 0xFFFFFFFF


def name_hash(name: str) -> int:
    """Random bits of an object that no instancer numbers, from its name: those that Blender users know from Cycles."""
    value = 0
    for byte in name.encode():
        signed = byte - 256 if byte >= 128 else byte
        value = (value * 37 + signed) & 0xFFFFFFFF
    return _mix(value)


def _mix(value: int) -> int:
    """Bob Jenkins' final mix (lookup3, public domain) of one number and 0."""
    mask = 0xFFFFFFFF

    def rotate(x: int, bits: int) -> int:
        return ((x << bits) | (x >> (32 - bits))) & mask

    a = b = c = (0xDEADBEEF + (2 << 2) + 13) & mask
    a = (a + value) & mask
    c ^= b
    c = (c - rotate(b, 14)) & mask
    a ^= c
    a = (a - rotate(c, 11)) & mask
    b ^= a
    b = (b - rotate(a, 25)) & mask
    c ^= b
    c = (c - rotate(b, 16)) & mask
    a ^= c
    a = (a - rotate(c, 4)) & mask
    b ^= a
    b = (b - rotate(a, 14)) & mask
    c ^= b
    return (c - rotate(b, 24)) & mask
