"""The film: what goes in comes out under Blender's conventions, whatever its size and number."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from luch import core
from luch.scene import Film
from numpy.typing import ArrayLike, NDArray

DATA = ["Depth", "Mist", "Position", "Normal", "UV", "Object Index", "Material Index"]
LIGHT = [f"{kind} {part}" for kind in ("Diffuse", "Glossy", "Transmission") for part in ("Direct", "Indirect", "Color")]
REST = ["Emission", "Environment", "Ambient Occlusion", "Denoising Albedo", "Denoising Normal", "Sample Count"]
SMALL = Film(width=2, height=1)


def make(film: Film = SMALL, **fields: object) -> core.film.Film:
    return core.film.Film(replace(film, **fields))


def feed(film: core.film.Film, name: str, values: ArrayLike, pixel: int = 0) -> int:
    rows = np.atleast_2d(np.asarray(values, np.float32))
    return int(film.add_samples(pixel, film.channel(name), rows))


@pytest.mark.parametrize("value", [0.1, 1.0, 1e4])
@pytest.mark.parametrize("samples", [1, 1024, 65536])
def test_equal_samples_have_their_own_mean(value: float, samples: int) -> None:
    film = make()
    feed(film, "Combined", np.full((samples, 4), value, np.float32))
    film.count_samples(0, samples)
    out = film.resolve()["Combined"][0, 0, :3]
    worst = np.abs(out / np.float32(value) - 1).max()
    print(f"{samples} samples of {value}: relative error {worst:.1e}")
    assert worst <= 1e-6


@pytest.mark.parametrize("value", [1e-38, 1e-20, 1e20, 1e34, 3e38])
def test_sums_of_finite_light_stay_finite(value: float) -> None:
    film = make(exposure=1.0)
    feed(film, "Combined", np.full((4096, 3), value, np.float32))
    film.count_samples(0, 4096)
    np.testing.assert_allclose(film.resolve()["Combined"][0, 0, :3], np.float32(value), rtol=1e-6)
    bright = make(exposure=100.0)
    feed(bright, "Combined", np.full((4, 3), value, np.float32))
    bright.count_samples(0, 4)
    assert np.isfinite(bright.resolve()["Combined"]).all()


def test_values_that_are_not_finite_are_counted_and_never_enter() -> None:
    film = make(passes=["Combined", "Mist"])
    bad = [[np.nan, 1, 1], [1, np.inf, 1], [1, 1, -np.inf], [0.5, 0.25, 0.125]]
    assert feed(film, "Combined", bad) == 3
    assert feed(film, "Mist", [[np.nan], [np.inf], [0.25]]) == 2
    film.count_samples(0, 1)
    out = film.resolve()
    assert out["Combined"][0, 0, :3].tolist() == [0.5, 0.25, 0.125]
    assert out["Mist"][0, 0, 0] == 0.75


def test_every_pass_has_blenders_name_shape_and_room_of_its_own() -> None:
    film = make(
        passes=["Combined", *DATA, *LIGHT, *REST, "CryptoObject00", "CryptoMaterial", "CryptoAsset"],
        lightgroups=["key", "fill"],
        aovs=[("glow", "COLOR"), ("wear", "VALUE")],
        cryptomatte_depth=5,
        width=3,
        height=2,
    )
    out = film.resolve()
    channels = {name: pixels.shape[2] for name, pixels in out.items()}
    assert all(pixels.shape[:2] == (2, 3) and pixels.dtype == np.float32 for pixels in out.values())
    assert next(iter(out)) == "Combined" and channels.pop("Combined") == 4
    one = {"Depth", "Mist", "Object Index", "Material Index", "Sample Count", "wear"}
    four = {f"Crypto{kind}0{i}" for kind in ("Object", "Material", "Asset") for i in range(3)} | {"glow"}
    three = {"Combined_key", "Combined_fill", "Position", "Normal", "UV", *LIGHT, *REST} - one
    assert channels == {**dict.fromkeys(one, 1), **dict.fromkeys(three, 3), **dict.fromkeys(four, 4)}
    film = make(passes=["Combined", *DATA, *LIGHT, *REST[:-1]])
    starts = sorted(film.channel(name) for name in ["Combined", *DATA, *LIGHT, *REST[:-1]])
    assert len(set(starts)) == len(starts)


def test_only_what_is_asked_for_is_stored() -> None:
    assert make().stride() == 4
    assert make(passes=["Combined", "Depth"]).stride() == 5
    assert make(passes=["Diffuse Direct"]).stride() == 4 + 3 + 3  # its colour is summed with it


def test_an_unknown_pass_is_named() -> None:
    with pytest.raises(ValueError, match='pass "Diffuse Dirct" is not known'):
        make(passes=["Diffuse Dirct"])
    with pytest.raises(ValueError, match="region is empty"):
        make(width=0)


def test_no_two_passes_have_one_name() -> None:
    film = make(passes=["Combined", "Depth"], aovs=[("Depth", "COLOR")])
    assert film.resolve()["Depth"].shape[2] == 4, "the user's own"
    with pytest.raises(ValueError, match='two passes are named "Combined_key"'):
        make(lightgroups=["key"], aovs=[("Combined_key", "COLOR")])
    with pytest.raises(ValueError, match="border"):
        make(border=(0, 0, 3, 1))


def test_alpha_and_exposure() -> None:
    film = make(passes=["Combined", "Emission", "Ambient Occlusion", "Denoising Albedo"], exposure=2.0)
    feed(film, "Combined", [[1, 2, 3, 0.25], [1, 2, 3, 0.75]])
    feed(film, "Combined", [[0, 0, 0, 1.5]], pixel=1)  # Russian roulette may overshoot
    for name in ("Emission", "Ambient Occlusion", "Denoising Albedo"):
        feed(film, name, [[0.5, 0.5, 0.5], [0.5, 0.5, 0.5]])
    film.count_samples(0, 2)
    film.count_samples(1, 1)
    out = film.resolve()
    assert out["Combined"][0].tolist() == [[2, 4, 6, 0.5], [0, 0, 0, 0]]
    assert out["Emission"][0, 0].tolist() == [1, 1, 1]
    assert out["Ambient Occlusion"][0, 0].tolist() == [0.5, 0.5, 0.5]
    assert out["Denoising Albedo"][0, 0].tolist() == [0.5, 0.5, 0.5]


def divided(light: ArrayLike, color: ArrayLike) -> NDArray[np.float32]:
    film = make(passes=["Diffuse Direct", "Diffuse Color"])
    feed(film, "Diffuse Direct", light)
    feed(film, "Diffuse Color", color)
    film.count_samples(0, 1)
    return film.resolve()["Diffuse Direct"][0, 0]


def test_light_is_divided_by_its_colour_and_missing_channels_take_the_others() -> None:
    assert divided([1, 2, 3], [0.5, 0.5, 0.5]).tolist() == [2, 4, 6]
    assert divided([1, 2, 0], [0.5, 0.5, 0]).tolist() == [2, 4, 3]
    assert divided([0, 0, 3], [0, 0, 0.5]).tolist() == [6, 6, 6]
    assert divided([1, 1, 1], [0, 0, 0]).tolist() == [0, 0, 0]


def test_the_first_sample_gives_depth_and_position_relative_to_the_scenes_origin() -> None:
    film = core.film.Film(replace(SMALL, passes=["Depth", "Position"]), (1e6, 0.0, -3.0))
    for pixel in (0, 1):
        film.set_first(pixel, 7.5, [1, 2, 3])
        film.count_samples(pixel, 10)
    film.set_background(1)
    out = film.resolve()
    assert out["Depth"][0, :, 0].tolist() == [7.5, np.float32(1e10)]
    assert out["Position"][0].tolist() == [[1000001, 2, 0], [0, 0, 0]]


def test_pixels_without_samples_are_empty() -> None:
    out = make(passes=["Combined", "Mist", "CryptoObject"]).resolve()
    assert all((pixels == 0).all() for pixels in out.values())


def test_cryptomatte_sorts_ids_by_weight_and_the_last_slot_takes_the_rest() -> None:
    film = make(passes=["CryptoObject"], cryptomatte_depth=4)
    channel = film.channel("CryptoObject00")
    for id_, weight in [(5.0, 0.1), (6.0, 0.4), (7.0, 0.2), (5.0, 0.2), (8.0, 0.05), (9.0, 0.04), (9.5, 0.01)]:
        film.add_crypto(0, channel, id_, weight)
    film.add_crypto(0, channel, 6.0, 0.0)
    film.add_crypto(0, channel, 6.0, np.nan)
    film.count_samples(0, 1)
    out = film.resolve()
    layers = np.concatenate([out["CryptoObject00"][0, 0], out["CryptoObject01"][0, 0]])
    np.testing.assert_allclose(layers, [6, 0.4, 5, 0.3, 7, 0.2, 8, 0.1], rtol=1e-6)


def test_deviations_weigh_uneven_parts_by_their_samples() -> None:
    film = core.film.Film(SMALL, marks=True)
    feed(film, "Combined", [[1, 0, 0], [2, 0, 0], [3, 0, 0]])
    film.count_samples(0, 3)
    film.mark(0, 4)  # before what would be the fifth sample: a part of 3
    feed(film, "Combined", [[6, 0, 1]])
    film.count_samples(0, 1)
    mean, deviation, share = film.deviations()
    assert mean[0, 0].tolist() == [3, 0, 0.25] and share == 0.75
    # Parts of means 2 and 6; variances v / 3 and v / 1 differ by 4 v / 3, and the mean of four has v / 4.
    np.testing.assert_allclose(deviation[0, 0], [(2 - 6) * np.sqrt(3) / 4, 0, -np.sqrt(3) / 4], rtol=1e-6)
    assert np.isnan(deviation[0, 1]).all(), "no sample, no error"
    with pytest.raises(RuntimeError, match="no marks"):
        make().deviations()


def test_of_two_marks_the_one_counts_that_leaves_more_even_parts() -> None:
    film = core.film.Film(SMALL, marks=True)
    shares = []
    for sample in range(64):
        if sample and sample & (sample - 1) == 0:
            film.mark(0, sample)
        feed(film, "Combined", [[1, 1, 1]])
        film.count_samples(0, 1)
        if sample:
            shares.append(film.deviations()[2])
    assert shares[0] == 0.5 and shares[62] == 0.5
    assert shares[32 - 1] == pytest.approx(16 / 33) and shares[48 - 2] == pytest.approx(32 / 48)
    assert all(1 / 3 <= share <= 2 / 3 for share in shares)


def test_merged_films_equal_one_film() -> None:
    settings = replace(SMALL, passes=["Depth", "Emission", "CryptoObject"])
    rng = np.random.default_rng(2)
    samples = rng.uniform(0, 3, (64, 3)).astype(np.float32)
    whole, parts = make(settings), [make(settings), make(settings)]
    for part, chosen in zip([whole, *parts], [slice(None), slice(0, 20), slice(20, None)], strict=True):
        values = samples[chosen]
        feed(part, "Combined", values)
        feed(part, "Emission", values)
        for id_ in values[:, 0]:
            part.add_crypto(0, part.channel("CryptoObject00"), float(np.ceil(id_)), 1.0)
        part.set_first(0, 4.0, [0, 0, 0])
        part.count_samples(0, len(values))
    parts[0].merge(parts[1])
    for name, pixels in whole.resolve().items():
        np.testing.assert_array_equal(parts[0].resolve()[name], pixels, err_msg=name)
    with pytest.raises(ValueError, match="same size and passes"):
        whole.merge(make())


@pytest.mark.parametrize(("width", "height"), [(1, 1), (16384, 1), (1, 16384), (16384, 16)])
def test_any_resolution_keeps_its_shape_and_mean(width: int, height: int) -> None:
    film = make(width=width, height=height)
    last = width * height - 1
    feed(film, "Combined", [[1, 2, 3, 0]], pixel=last)
    film.count_samples(last, 1)
    pixels = film.resolve()["Combined"]
    assert pixels.shape == (height, width, 4)
    assert pixels[-1, -1].tolist() == [1, 2, 3, 1] and pixels.sum() == 7


def test_a_border_makes_a_film_of_its_own_size() -> None:
    assert make(width=20, height=10, border=(3, 4, 8, 6)).resolve()["Combined"].shape == (2, 5, 4)
