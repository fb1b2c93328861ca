"""Distribution ray tracing on every device: the limits that it sets are the same."""

from __future__ import annotations

from support.devices import both, check_equal
from support.everything import everything


def test_a_scene_of_everything_is_the_cpus(place: str) -> None:
    cpu, _, ours, stats = both(everything(integrator="DISTRIBUTION"))
    check_equal("Combined", cpu["Combined"], ours["Combined"], place)
    assert not stats["kernel_plan"]["PHOTONS"]
    paths, *_ = both(everything())
    assert cpu["Combined"][..., :3].mean() < paths["Combined"][..., :3].mean()
