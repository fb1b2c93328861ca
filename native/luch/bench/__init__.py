"""Races and checks that need no Blender: ``python -m luch bench`` and ``python -m luch check``."""
