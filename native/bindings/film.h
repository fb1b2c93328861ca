// Reads luch.scene.Film from Python and gives a film's passes to Python.
#pragma once
#include "bindings/bind.h"
#include "cpu/film.h"

namespace luch::bindings {

// origin: Scene.origin.
cpu::FilmSpec read_film(const py::handle& film, const py::handle& origin);

// {pass name: float32 (H, W, channels)}, bottom row first.
py::dict resolve_film(const cpu::Film& film);

// (sums float64 (pixels, channels), counts uint32 (pixels,)): the film's own memory, which owner keeps alive.
py::tuple film_arrays(cpu::Film& film, const py::object& owner);

// (mean, deviation, share), float32 (H, W, 3) and a number, as Film::deviations has them.
py::tuple film_deviations(const cpu::Film& film);

}  // namespace luch::bindings
