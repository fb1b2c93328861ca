"""What build.py is made of. Only the standard library, any Python from 3.9; `inside/` runs in .venv with bpy."""
