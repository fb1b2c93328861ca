"""Words behind `--` on Blender's command line."""

from __future__ import annotations

import pytest

from addon.command_line import CommandLineError, overrides


def test_words_of_others_are_left_alone() -> None:
    assert overrides(("blender", "-b", "x.blend", "--luch-device", "CUDA")) == {}  # Blender's own part
    assert overrides(("blender", "--", "--cycles-device", "OPTIX", "file")) == {}


def test_the_device_is_named_in_either_case() -> None:
    assert overrides(("blender", "--", "--other", "--luch-device", "cuda")) == {"device": "CUDA"}


@pytest.mark.parametrize("words", [("--luch-device", "TPU"), ("--luch-devise", "CUDA"), ("--luch-device",)])
def test_a_misspelt_option_is_told(words: tuple[str, ...]) -> None:
    with pytest.raises(CommandLineError, match=r"--luch-device CPU\|CUDA"):
        overrides(("blender", "--", *words))


def test_effects_are_left_out_and_forced_by_name() -> None:
    words = ("--luch-without-effect", "coat", "--luch-without-effect", "depth of field", "--luch-force-effect", "ALL")
    assert overrides(("blender", "--", *words)) == {
        "without_effects": ["coat", "depth of field"],
        "force_effects": ["ALL"],
    }


def test_an_error_is_asked_for_with_as_many_samples_as_it_takes() -> None:
    words = ("blender", "--", "--luch-error", "0.01", "--luch-time", "600")
    assert overrides(words) == {"error_limit": 0.01, "time_limit": 600.0, "samples": 65536, "quality": "CUSTOM"}
    assert overrides((*words, "--luch-samples", "128"))["samples"] == 128
    with pytest.raises(CommandLineError, match="--luch-error"):
        overrides(("blender", "--", "--luch-error", "-1"))


def test_the_dial_and_denoising_can_be_asked_for_and_an_error_overrules_a_dial() -> None:
    assert overrides(("blender", "--", "--luch-quality", "good", "--luch-denoise")) == {
        "quality": "GOOD", "denoise": True,
    }  # fmt: skip
    assert overrides(("blender", "--", "--luch-error", "0.02"))["quality"] == "CUSTOM"
    assert overrides(("blender", "--", "--luch-samples", "4", "--luch-quality", "HIGH"))["quality"] == "HIGH"


def test_the_integrator_is_named_in_any_case() -> None:
    assert overrides(("blender", "--", "--luch-integrator", "photon"))["integrator"] == "PHOTON"
    with pytest.raises(CommandLineError, match="BIDIRECTIONAL"):
        overrides(("blender", "--", "--luch-integrator", "bidirectional"))


def test_the_sampler_is_named_in_any_case() -> None:
    assert overrides(("blender", "--", "--luch-sampler", "lattice"))["sampler"] == "LATTICE"
    with pytest.raises(CommandLineError, match="HALTON"):
        overrides(("blender", "--", "--luch-sampler", "halton"))
