"""Runs in .venv, where bpy is. Started by build.py, one job per file."""
