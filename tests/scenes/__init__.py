"""Scenes made by script from Blender's own primitives: nothing is downloaded, nothing is copied."""
