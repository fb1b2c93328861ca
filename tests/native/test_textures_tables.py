"""Textures that read tables made on the host: skies, luminaires, colours of spectra."""

from __future__ import annotations

import numpy as np
import pytest
from luch import core, ies, sky, spectrum
from numpy.typing import NDArray

F32 = NDArray[np.float32]
run = core.textures.run
EARTH = sky.Atmosphere(True, True, 0.0095, 1.0, 0.5, 0.3, 100.0, 1.0, 1.0, 1.0)


def directions(count: int = 2000, seed: int = 1) -> F32:
    v = np.random.default_rng(seed).normal(size=(3, count))
    return np.asarray(v / np.linalg.norm(v, axis=0), np.float32)


def test_daylight_is_whiter_than_candlelight() -> None:
    candle, daylight = spectrum.blackbody(1900.0), spectrum.blackbody(6504.0)
    assert candle[0] > 4 * candle[1] * candle[2] and abs(daylight - 1).max() < 0.06


def test_blackbody_operation_follows_plancks_law() -> None:
    kelvin = np.linspace(600, 14000, 400, dtype=np.float32)[None]
    out = run("BLACKBODY", kelvin, [0], table=spectrum.blackbody_table().ravel())
    np.testing.assert_allclose(out.T, np.maximum(spectrum.blackbody(kelvin[0].astype(np.float64)), 0), atol=2e-4)


def test_wavelengths_outside_the_visible_are_black() -> None:
    nm = np.array([[100.0, 379.0, 555.0, 781.0, np.nan, np.inf]], np.float32)
    out = run("WAVELENGTH", nm, [0], table=spectrum.wavelength_table().ravel())
    assert out[1, 2] > 0.4 and np.isfinite(out).all()
    assert np.all(out[:, [0, 1, 3, 4, 5]] == 0)


def test_observer_integrates_to_equal_x_y_z() -> None:
    sums = spectrum.OBSERVER.sum(axis=0)
    assert len(spectrum.OBSERVER) == 81
    np.testing.assert_allclose(sums / sums[1], 1.0, atol=2e-3)


@pytest.mark.parametrize("multiple", [True, False])
def test_sky_is_brightest_at_the_sun(multiple: bool) -> None:
    settings = sky.Atmosphere(**(EARTH.__dict__ | {"multiple_scattering": multiple, "sun_size": 0.2}))
    table = sky.atmosphere_table(settings)
    d = directions()
    color = run("SKY_ATMOSPHERE", d, [0], table=table)
    towards = np.array(sky.sun_direction(settings.sun_elevation, settings.sun_rotation)) @ d
    assert np.isfinite(color).all() and color.min() >= 0
    assert color[:, towards > np.cos(0.09)].min() > 5 * color[:, towards < np.cos(0.11)].max()


def test_sky_is_mirrored_at_the_suns_meridian() -> None:
    table = sky.atmosphere_table(sky.Atmosphere(**(EARTH.__dict__ | {"sun_rotation": 0.0, "sun_disc": False})))
    d = directions()
    mirrored = d * np.array([[-1], [1], [1]], np.float32)
    left, right = (run("SKY_ATMOSPHERE", v, [0], table=table) for v in (d, mirrored))
    np.testing.assert_allclose(left, right, rtol=2e-3, atol=1e-4)


def test_thin_air_darkens_the_sky() -> None:
    up = np.array([[0.3], [0.1], [0.95]], np.float32)
    high = sky.Atmosphere(**(EARTH.__dict__ | {"altitude": 30000.0}))
    low = run("SKY_ATMOSPHERE", up, [0], table=sky.atmosphere_table(EARTH))
    assert np.all(run("SKY_ATMOSPHERE", up, [0], table=sky.atmosphere_table(high)) < 0.2 * low)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 0.0])
def test_no_direction_breaks_the_sky(bad: float) -> None:
    d = np.full((3, 9), bad, np.float32)
    assert np.isfinite(run("SKY_ATMOSPHERE", d, [0], table=sky.atmosphere_table(EARTH))).all()
    assert np.isfinite(run("SKY_PREETHAM", d, [0], table=sky.preetham_table((0.0, 0.6, 0.8), 2.2))).all()


def ies_text(h_angles: str, rows: int, kind: int = 1) -> str:
    v_angles = "0 45 90" if kind == 1 else "-90 0 90"
    count = len(h_angles.split())
    values = "\n".join(" ".join(str(10 * row + k + 1) for k in range(3)) for row in range(rows))
    return f"IESNA\nTILT=NONE\n1 -1 2 3 {count} {kind} 2 0 0 0\n1 1 50\n{v_angles}\n{h_angles}\n{values}\n"


@pytest.mark.parametrize(
    ("h_angles", "full"), [("0", 2), ("0 45 90", 9), ("0 60 120 180", 7), ("0 90 180 270", 5), ("0 120 240 360", 4)]
)
def test_luminaire_covers_the_full_turn(h_angles: str, full: int) -> None:
    table = ies.parse_ies(ies_text(h_angles, len(h_angles.split())))
    assert table[0] == full and table[1] == 3
    np.testing.assert_allclose(table[2 : 2 + full][[0, -1]], [0, 2 * np.pi], rtol=1e-6)
    rows = table[2 + full + 3 :].reshape(full, 3)
    if len(h_angles.split()) < full:  # completed by us
        np.testing.assert_array_equal(rows[0], rows[-1])


def test_luminaire_shows_its_candela_straight_down() -> None:
    table = ies.parse_ies(ies_text("0", 1))
    down = np.array([[0.0], [0.0], [-1.0], [1.5]], np.float32)
    np.testing.assert_allclose(run("IES", down, [0], table=table)[0, 0], 1.5 * 2 * ies.CANDELA_TO_WATT, rtol=1e-6)


def test_luminaire_is_dark_above_its_last_angle() -> None:
    d = np.concatenate([directions(), np.ones((1, 2000), np.float32)])
    out = run("IES", d, [0], table=ies.parse_ies(ies_text("0 45 90", 3)))[0]
    assert np.all(out[d[2] > 0.001] == 0) and out[d[2] < -0.1].min() > 0


def test_unreadable_luminaire_is_even() -> None:
    d = np.concatenate([directions(), np.ones((1, 2000), np.float32)])
    np.testing.assert_array_equal(run("IES", d, [0], table=ies.constant_ies())[0], np.float32(ies.UNREADABLE))


@pytest.mark.parametrize("text", ["", "IESNA\nTILT=NONE\n1 2 3", "IESNA\nTILT=NONE\nabc", ies_text("0 45 90", 2)])
def test_broken_luminaire_says_what_is_wrong(text: str) -> None:
    with pytest.raises(ies.IesError, match="IES file: "):
        ies.parse_ies(text)
