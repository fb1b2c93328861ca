"""Files that merge (luch.merge), beside the frames of a headless render: `-- --luch-mergeable`.

Blender's own files cannot carry the film's sums: their layers are its passes. So the sums, with all passes, go into a
file of Luch's beside the frame, NAME.sums.exr, and `luch merge a.sums.exr b.sums.exr -o c.exr` makes one picture of them.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from luch import cryptomatte, record
from luch.scene import Scene

# By scene and view layer: what the frame's file will be followed by. A frame that is not written leaves nothing but this.
_waiting: dict[str, dict[str, tuple[dict[str, Any], dict[str, Any]]]] = {}


def keep(scene: Any, layer: str, exported: Scene, result: Any) -> None:
    """Hold passes, sums and statistics of a view layer until its frame is written."""
    kept = _waiting.setdefault(scene.name, {})
    kept.pop(layer, None)
    if result.sums is None:
        return
    metadata = {
        **record.header_fields(result.stats),
        "luch.scene": exported.name,
        **cryptomatte.metadata(exported, layer),
        **result.sums.header(),
    }
    kept[layer] = {**result.passes, **result.sums.layers()}, metadata


def write(scene: Any, frame: Path) -> list[Path]:
    """The files of a frame that was just written, one a view layer. Raises OSError, ImageError."""
    from luch import image

    written = []
    layers = _waiting.pop(scene.name, {})
    for layer, (passes, metadata) in layers.items():
        name = frame.stem if len(layers) == 1 else f"{frame.stem}.{layer}"
        written.append(frame.with_name(f"{name}.sums.exr"))
        image.write_exr(written[-1], passes, metadata=metadata)
    return written
