"""Started by test_extension.py in a process of its own: argv = zip, picture. Installs as a user would, renders, checks."""

from __future__ import annotations

import sys
from pathlib import Path

import bpy  # first: it makes Blender's own modules importable

# isort: split
import addon_utils

ZIP, PICTURE = Path(sys.argv[1]), Path(sys.argv[2])


def main() -> None:
    addon_utils.enable("bl_pkg")  # Blender's extension manager; the bpy module starts without it
    result = bpy.ops.extensions.package_install_files(
        filepath=str(ZIP), repo="user_default", enable_on_install=True, overwrite=True
    )
    assert result == {"FINISHED"}, result
    import luch

    resources = Path(bpy.utils.resource_path("USER"))
    assert Path(luch.__file__).is_relative_to(resources), f"{luch.__file__} is not the installed one"

    scene = bpy.context.scene  # the factory file: cube, lamp, camera
    scene.render.engine = "LUCH"
    scene.luch.samples = 4
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 48, 32, 100
    scene.render.filepath = str(PICTURE)
    bpy.ops.render.render(write_still=True)
    print("INSTALLED", luch.core.__name__)


main()
