"""Open Image Denoise through its C functions."""

from __future__ import annotations

import numpy as np
import pytest
from luch import denoise
from luch.render import render
from support.everything import everything


def noisy(noise: float) -> tuple[np.ndarray, np.ndarray]:
    y, x = np.mgrid[:64, :64] / 64.0
    truth = np.stack([0.2 + x, 0.5 + 0.0 * x, 0.2 + y, np.ones_like(x)], axis=2)
    rng = np.random.default_rng(1)
    return truth, (truth * (1.0 + noise * rng.normal(size=truth.shape))).astype(np.float32)


def test_noise_is_taken_out_and_alpha_stays() -> None:
    truth, picture = noisy(0.3)
    clean = denoise.denoise(picture)
    assert np.array_equal(clean[..., 3], picture[..., 3])
    left = np.mean((clean - truth)[..., :3] ** 2) / np.mean((picture - truth)[..., :3] ** 2)
    assert left < 0.1


def test_surfaces_guide_it() -> None:
    """A checker of two greys under strong noise: the albedo says where the edges are."""
    y, x = np.mgrid[:64, :64]
    albedo = np.repeat(np.where((x // 4 + y // 4) % 2, 0.7, 0.2)[..., None], 3, axis=2).astype(np.float32)
    normal = np.zeros_like(albedo)
    normal[..., 2] = 1.0
    noise = 1.0 + 0.8 * np.random.default_rng(2).normal(size=albedo.shape)
    picture = (albedo * noise).astype(np.float32)

    def error(result: np.ndarray) -> float:
        return float(np.mean((result - albedo) ** 2))

    assert error(denoise.denoise(picture, albedo, normal)) < 0.5 * error(denoise.denoise(picture))


def test_without_the_library_the_remedy_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(denoise, "_places", lambda: iter(["/nowhere/libOpenImageDenoise.so"]))
    denoise.library.cache_clear()
    try:
        with pytest.raises(ImportError, match="Blender carries it"):
            denoise.library()
        assert not denoise.available()
    finally:
        denoise.library.cache_clear()


def test_the_picture_before_the_filter_is_a_pass_where_it_is_asked_for() -> None:
    scene = everything()
    plain = render(scene).passes
    scene.settings.denoise = True
    assert denoise.NOISY_PASS not in render(scene).passes
    scene.film.passes = ["Combined", denoise.NOISY_PASS]
    both = render(scene).passes
    assert set(both) == {"Combined", denoise.NOISY_PASS}
    assert np.array_equal(both[denoise.NOISY_PASS], plain["Combined"])
    assert not np.array_equal(both["Combined"], plain["Combined"])
    scene.settings.denoise = False
    assert np.array_equal(render(scene).passes[denoise.NOISY_PASS], plain["Combined"])
