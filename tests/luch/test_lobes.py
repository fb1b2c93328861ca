"""What luch.effects.lobes says of programs holds for every point: code is left out by it."""

from __future__ import annotations

import numpy as np
import pytest
from luch._native import core
from luch.effects.lobes import possible_in
from luch.scene import Image, Material, Program
from luch.shader import ProgramBuilder
from luch.shader_code import OPS
from support.effects import ONE, closure, principled, program, scene

CLOSURES = sorted(name for name, op in OPS.items() if op.closure and name.startswith("CLOSURE_"))


def lobes_made(surface: Program, seed: int) -> int:
    """Most lobes that the program really makes at 64 points seen from everywhere."""
    rng = np.random.default_rng(seed)
    incoming = rng.normal(size=(64, 3))
    incoming /= np.linalg.norm(incoming, axis=1, keepdims=True)
    incoming[:, 2] = np.abs(incoming[:, 2])
    up = np.repeat(np.array([[0.0, 0.0, 1.0]], np.float32), 64, axis=0)
    nowhere = np.full(64, 0xFFFFFFFF, np.uint32)
    points = {"incoming": incoming.astype(np.float32), "normal": up, "geometric_normal": up, "instance": nowhere}
    run = core.shade.run_program(surface.code, surface.constants, surface.register_count, surface.tables, 64, points)
    return int(np.max(run["lobes"]))


def chosen(rng: np.random.Generator, name: str) -> float:
    """A number that an input may well have, 0 and 1 among them."""
    if name in ("ior", "coat_ior", "thin_film_ior"):
        return float(rng.choice([1.0, 1.33, 1.5]))
    return float(rng.choice([0.0, 1.0, rng.random()]))


@pytest.mark.parametrize("seed", range(40))
def test_no_point_has_more_lobes_than_were_foreseen(seed: int) -> None:
    rng = np.random.default_rng(seed)
    layers = ("metallic", "thin_wall", "subsurface_weight", "transmission_weight", "coat_weight", "sheen_weight",
              "anisotropic", "diffuse_roughness", "ior", "specular_ior_level", "thin_film_thickness")  # fmt: skip

    def build(builder: ProgramBuilder) -> None:
        for _ in range(int(rng.integers(1, 3))):
            inputs = {name: chosen(rng, name) * (400.0 if name == "thin_film_thickness" else 1.0) for name in layers}
            principled(builder, float(rng.choice([1.0, 0.5])), **inputs)
            if rng.random() < 0.5:
                closure(builder, "CLOSURE_DIFFUSE", {"color": ONE, "roughness": chosen(rng, "roughness")})

    made = program(build)
    foreseen = possible_in(scene(materials=[Material("Any", made)])).most_lobes
    assert lobes_made(made, seed) <= foreseen


@pytest.mark.parametrize("name", [name for name in CLOSURES if "PRINCIPLED" not in name])
def test_each_node_makes_no_more_lobes_than_were_foreseen(name: str) -> None:
    inputs: dict[str, object] = {
        "color": ONE, "base_color": ONE, "radius": (0.0, 1.0, 1.0), "ior": 1.4, "size": 0.5, "smooth": 0.5,
        "roughness": 0.3, "alpha": 0.2,
    }  # fmt: skip
    made = program(lambda builder: closure(builder, name, inputs))
    assert lobes_made(made, 1) <= possible_in(scene(materials=[Material("Any", made)])).most_lobes


@pytest.mark.parametrize(("inputs", "needs"), [
    ({}, set()), ({"coat_weight": 0.2}, {"coat"}), ({"metallic": 0.5}, {"metals"}),
    ({"metallic": 1.0, "transmission_weight": 1.0}, {"metals"}), ({"transmission_weight": 0.5}, {"transmission"}),
    ({"thin_wall": 1.0}, {"thin walls"}), ({"anisotropic": 0.3}, {"anisotropy"}),
    ({"diffuse_roughness": 0.3}, {"rough diffuse"}),
])  # fmt: skip
def test_principled_needs_what_its_inputs_ask_for(inputs: dict[str, object], needs: set[str]) -> None:
    assert possible_in(scene(lambda builder: principled(builder, **inputs))).needs == needs


def test_exits_of_walks_ask_a_program_where_it_may_bend_the_normal() -> None:
    skin: dict[str, object] = {"color": ONE, "radius": ONE, "ior": 1.4, "alpha": 0.2}
    plain, bent, thin = (
        scene(lambda builder, inputs=inputs: closure(builder, "CLOSURE_SUBSURFACE", inputs))
        for inputs in (skin, {**skin, "normal": (0.1, 0.0, 1.0)}, {**skin, "radius": 0.0, "normal": (0.1, 0.0, 1.0)})
    )
    assert "bent exits" in possible_in(bent).needs
    assert "bent exits" not in possible_in(plain).needs | possible_in(thin).needs


def test_distributions_and_images_are_needed_where_they_are_chosen() -> None:
    beckmann = scene(lambda builder: closure(builder, "CLOSURE_GLOSSY", {"color": ONE}, params=(1, 1)))
    assert possible_in(beckmann).needs == {"beckmann"}
    phong = scene(lambda builder: closure(builder, "CLOSURE_GLOSSY", {"color": ONE}, params=(1, 3)))
    assert possible_in(phong).needs == {"ashikhmin shirley"}
    bytes_ = Image("Bytes", np.zeros((2, 2, 4), np.uint8))
    floats, halves = Image("Floats", np.zeros((2, 2, 3), np.float32)), Image("Halves", np.zeros((2, 2, 3), np.float16))
    assert possible_in(scene(images=[bytes_])).needs == set()
    assert possible_in(scene(images=[bytes_, floats, halves])).needs == {"float images", "half images"}
