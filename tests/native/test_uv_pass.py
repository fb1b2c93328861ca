"""The UV pass, whatever elements a mesh's UV map is stored by."""

from __future__ import annotations

import numpy as np
import pytest
from luch.render import render
from luch.scene import Attribute, Mesh
from support.from_above import scene_of

CORNERS = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32)
TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)  # below and above the diagonal
OF_FACES = np.array([[0.25, 0.75], [0.5, 0.125]], np.float32)


@pytest.mark.parametrize(
    ("domain", "data", "below", "above"),
    [
        ("FACE", OF_FACES, OF_FACES[0], OF_FACES[1]),
        ("MESH", OF_FACES[:1], OF_FACES[0], OF_FACES[0]),
        ("CORNER", np.repeat(OF_FACES, 3, axis=0), OF_FACES[0], OF_FACES[1]),
        ("POINT", np.repeat(OF_FACES[:1], 4, axis=0), OF_FACES[0], OF_FACES[0]),
    ],
)
def test_a_uv_map_of_any_domain_is_read_row_by_row(
    domain: str, data: np.ndarray, below: np.ndarray, above: np.ndarray
) -> None:
    """Found by the fuzzer (seed 20056): a map by faces was read as one by corners, three rows a triangle."""
    mesh = Mesh("Quad", CORNERS, TRIANGLES, material_slots=np.zeros(2, np.uint16))
    mesh.attributes["Map"], mesh.uv_active = Attribute(data, domain), "Map"
    uv = render(scene_of(mesh, width=1.9, size=16, passes=("Combined", "UV"))).passes["UV"]
    np.testing.assert_allclose(uv[2, 13], [*below, 1.0], atol=1e-6)
    np.testing.assert_allclose(uv[13, 2], [*above, 1.0], atol=1e-6)
