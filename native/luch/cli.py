"""The command line: renders ``.luch`` scenes without Blender and says what is in them."""

from __future__ import annotations

import argparse
import signal
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any

import numpy as np

from luch import __version__, cryptomatte, integrators, samplers
from luch.accuracy import percent
from luch.bench import device_rays
from luch.cuda import DeviceError
from luch.effects import effects_of
from luch.scene import Scene
from luch.scenefile import read_scene
from luch.stopping import CUSTOM, STEPS, UNLIMITED_SAMPLES

if TYPE_CHECKING:
    from luch.render import Progress

CANCELLED = 130  # exit status after Ctrl+C, as shells have it


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command. Returns 0, 1 after an error that was told on stderr, 130 after Ctrl+C."""
    options = _parser().parse_args(arguments)
    try:
        status: int = options.run(options)
    except (OSError, ValueError, ImportError, DeviceError) as error:
        print(f"luch: {error}", file=sys.stderr)
        return 1
    return status


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m luch", description=__doc__)
    parser.add_argument("--version", action="version", version=f"Luch {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    render = commands.add_parser("render", help="render a scene to a multilayer .exr or a .png")
    render.add_argument("scene", type=Path, help="a .luch file")
    render.add_argument("-o", "--output", type=Path, required=True, help="PATH.exr (all passes) or PATH.png (Combined)")
    render.add_argument("--samples", type=_positive(int), help="samples per pixel (default: the scene's)")
    render.add_argument("--time", type=_positive(float), metavar="S", help="stop after this many seconds")
    render.add_argument(
        "--error",
        type=_positive(float),
        metavar="E",
        help="stop when the picture's error is that small, e.g. 0.01; without --samples, however many samples it takes",
    )
    render.add_argument(
        "--quality",
        type=str.upper,
        choices=tuple(STEPS),
        help="one dial: an error, and the settings that reach it soonest on this scene; --time still holds",
    )
    render.add_argument("--report", type=Path, metavar="PATH", help="a report.json that --quality chooses by")
    render.add_argument("--denoise", action="store_true", default=None, help="Combined through Open Image Denoise")
    render.add_argument("--seed", type=int, help="seed of the sampler")
    render.add_argument("--integrator", type=str.upper, choices=integrators.NAMES, help="how light is followed")
    render.add_argument("--sampler", type=str.upper, choices=samplers.NAMES, help="how random numbers are spread")
    render.add_argument("--first-sample", type=int, metavar="N", help="leave out N samples that another render takes")
    render.add_argument(
        "--samples-in-all", type=int, metavar="N", help="samples of all renders that are to be merged with this one"
    )
    render.add_argument(
        "--device", type=str.upper, choices=("CPU", "CUDA"), help="what computes (default: the scene's)"
    )
    render.add_argument(
        "--without-effect", action="append", metavar="NAME", help="leave out an effect that `info` lists"
    )
    render.add_argument(
        "--force-effect",
        action="append",
        metavar="NAME",
        help="simulate an effect that the scene lacks; ALL: every one",
    )
    render.add_argument("--gpus", type=_positive(int), help="how many GPUs share the samples (default: all)")
    render.add_argument("--general-kernels", action="store_true",
                        help="on GPUs: compile none for the scene where those for all scenes serve")  # fmt: skip
    render.add_argument("--threads", type=int, help="0: one per processor")
    render.add_argument("--adaptive", action="store_true", help="until that error: more samples where the error is")
    render.add_argument("--mergeable", action="store_true", help="keep the film's sums in the .exr, for `merge`")
    render.add_argument(
        "--verify",
        action="store_true",
        help="render two halves with other seeds and hold the claimed error against them",
    )
    render.add_argument("--json", type=Path, metavar="PATH", help="write everything known about the render")
    render.add_argument("--quiet", action="store_true", help="no progress on stderr")
    render.set_defaults(run=_render)

    merging = commands.add_parser("merge", help="one picture of renders with other samples or other seeds")
    merging.add_argument("pictures", type=Path, nargs="+", help=".exr files written by `render --mergeable`")
    merging.add_argument("-o", "--output", type=Path, required=True, help="PATH.exr")
    merging.add_argument("--mergeable", action="store_true", help="keep the sums, to merge on")
    merging.set_defaults(run=_merge)

    reporting = commands.add_parser(
        "report", help="what accuracy costs in a scene: error against time, effects' prices"
    )
    reporting.add_argument("scene", type=Path, help="a .luch file")
    reporting.add_argument("-o", "--output", type=Path, required=True, metavar="FOLDER", help="made if it is not there")
    reporting.add_argument("--seconds", type=_positive(float), default=60.0, help="how long it may take (default: 60)")
    reporting.add_argument(
        "--size", type=_positive(int), default=0, help="pixels along the longer side (default: as the time allows)"
    )
    reporting.add_argument(
        "--device", type=str.upper, choices=("CPU", "CUDA"), help="what computes (default: the scene's)"
    )
    reporting.add_argument("--threads", type=int, help="0: one per processor")
    reporting.add_argument("--progress", action="store_true", help="a line of JSON on stdout about twice a second")
    reporting.add_argument("--quiet", action="store_true", help="no progress on stderr")
    reporting.set_defaults(run=_report)

    info = commands.add_parser("info", help="say what is in a scene")
    info.add_argument("scene", type=Path, help="a .luch file")
    info.set_defaults(run=_info)

    bench = commands.add_parser("bench", help="races of the core alone")
    races = bench.add_subparsers(required=True, metavar="RACE")
    rays = races.add_parser("rays", help="bare rays through every structure, on a GPU")
    rays.set_defaults(run=_bench_rays)
    device_rays.add_arguments(rays)
    return parser


def _positive(kind: Callable[[str], Any]) -> Callable[[str], Any]:
    def convert(text: str) -> Any:
        value = kind(text)
        if not value > 0:
            raise argparse.ArgumentTypeError(f"{text} is not above 0")
        return value

    return convert


def _render(options: argparse.Namespace) -> int:
    from luch import image, record
    from luch.render import render

    suffix = options.output.suffix.lower()
    if suffix not in (".exr", ".png"):
        raise ValueError(f"{options.output}: the name must end in .exr or .png")
    if not options.output.absolute().parent.is_dir():
        raise ValueError(f"{options.output}: its folder does not exist. Create it first.")
    image.openimageio()  # a missing library is told before the work, not after
    scene = read_scene(options.scene)
    _override(scene, options)
    for warning in scene.warnings:
        print(f"luch: {warning}", file=sys.stderr)
    with _Interrupt() as interrupt, _Line(quiet=options.quiet) as line:

        def watch(progress: Progress) -> bool:
            line.show(progress)
            return not interrupt.asked

        result = render(scene, progress=watch)
    for warning in result.stats.get("warnings", [])[len(scene.warnings) :]:
        print(f"luch: {warning}", file=sys.stderr)
    if suffix == ".png":
        image.write_png(options.output, result.passes["Combined"], metadata=record.header_fields(result.stats))
    else:
        metadata = {
            **record.header_fields(result.stats),
            "luch.scene": scene.name,
            **cryptomatte.metadata(scene, "ViewLayer"),
        }
        passes = dict(result.passes)
        if result.sums is not None:
            passes |= result.sums.layers()
            metadata |= result.sums.header()
        image.write_exr(options.output, passes, metadata=metadata)
    if options.json is not None:
        record.write_json(options.json, result.stats)
    print(f"{options.output}: {record.line(result.stats)}")
    return CANCELLED if result.cancelled else 0


def _merge(options: argparse.Namespace) -> int:
    from luch import image, merge, pixel_error, record

    if options.output.suffix.lower() != ".exr":
        raise ValueError(f"{options.output}: the name must end in .exr")
    parts, headers = zip(*(merge.read_sums(path) for path in options.pictures), strict=True)
    whole = merge.merge(parts)
    film, found = whole.native(), whole.estimate()
    passes: dict[str, Any] = dict(film.resolve())
    stats: dict[str, Any] = {"samples": whole.samples, "stopped_by": "merged", "merged": len(parts)}
    if found is not None:
        stats |= found.statistics()
        passes |= whole.error_passes([pixel_error.ERROR_PASS, pixel_error.RELIABILITY_PASS])
    stats["render_seconds"] = sum(float(header.get("luch.render_seconds", 0.0)) for header in headers)
    kept = {key: value for key, value in headers[0].items() if key.startswith("cryptomatte/") or key == "luch.scene"}
    metadata = {**kept, **record.header_fields(stats)}
    if options.mergeable:
        passes |= whole.layers()
        metadata |= whole.header()
    image.write_exr(options.output, passes, metadata=metadata)
    print(f"{options.output}: {len(parts)} renders, {record.line(stats)}")
    return 0


def _report(options: argparse.Namespace) -> int:
    from luch.report import command

    with _Interrupt() as interrupt:
        return command.run(options, read_scene(options.scene), lambda: not interrupt.asked)


def _override(scene: Scene, options: argparse.Namespace) -> None:
    settings = scene.settings
    if options.error is not None:
        settings.error_limit, settings.samples = options.error, UNLIMITED_SAMPLES
    if options.error is not None or options.samples is not None:
        settings.quality = CUSTOM  # a dial in the file gives way
    if options.quality is not None:
        settings.quality = options.quality
    if options.report is not None:
        settings.quality_report = str(options.report)
    if options.denoise is not None:
        settings.denoise = options.denoise
    if options.samples is not None:
        settings.samples = options.samples
    if options.first_sample is not None:
        settings.first_sample = options.first_sample
    if options.samples_in_all is not None:
        settings.samples_in_all = options.samples_in_all
    if options.time is not None:
        settings.time_limit = options.time
    if options.seed is not None:
        settings.seed = options.seed
    if options.sampler is not None:
        settings.sampler = options.sampler
    if options.integrator is not None:
        settings.integrator = options.integrator
    settings.mergeable, settings.verify = options.mergeable, options.verify
    settings.adaptive = settings.adaptive or options.adaptive
    if options.device is not None:
        settings.device = options.device
    if options.threads is not None:
        settings.threads = options.threads
    if options.gpus is not None:
        settings.gpus = options.gpus
    settings.own_kernels = settings.own_kernels and not options.general_kernels
    if options.without_effect:
        settings.without_effects = options.without_effect
    if options.force_effect:
        settings.force_effects = options.force_effect


class _Interrupt:
    """Turns the first Ctrl+C into a request to stop and keep the picture; a second one stops at once."""

    def __init__(self) -> None:
        self.asked = False
        self._before: Any = None

    def __enter__(self) -> _Interrupt:
        self._before = signal.signal(signal.SIGINT, self._ask)
        return self

    def __exit__(self, *_: object) -> None:
        signal.signal(signal.SIGINT, self._before)

    def _ask(self, _signal: int, _frame: FrameType | None) -> None:
        self.asked = True
        signal.signal(signal.SIGINT, self._before)


class _Line:
    """One line of progress, rewritten in place on a terminal, left out where nobody watches."""

    def __init__(self, *, quiet: bool) -> None:
        self._on = not quiet and sys.stderr.isatty()
        self._next = 0.0

    def __enter__(self) -> _Line:
        return self

    def __exit__(self, *_: object) -> None:
        if self._on:
            print(file=sys.stderr)

    def show(self, progress: Progress) -> None:
        now = time.monotonic()
        if not self._on or now < self._next:
            return
        self._next = now + 0.25
        if progress.preparing:
            doing = progress.doing_before
            self._write(doing[0].lower() + doing[1:])
            return
        error = f", error {percent(progress.error)} %" if progress.error is not None else ""
        left = f", {progress.remaining_seconds:.0f} s left" if np.isfinite(progress.remaining_seconds) else ""
        self._write(f"{progress.fraction:6.1%}  {progress.samples} of {progress.total_samples} samples{error}{left}")

    @staticmethod
    def _write(text: str) -> None:
        print(f"\r{text:70}", end="", file=sys.stderr, flush=True)


def _bench_rays(options: argparse.Namespace) -> int:
    return device_rays.run(options)


def _info(options: argparse.Namespace) -> int:
    scene = read_scene(options.scene)
    print("\n".join(describe(scene)))
    print(f"\n{effects_of(scene)}")
    return 0


def describe(scene: Scene) -> list[str]:
    """What a scene holds, one line per subject."""
    film, settings, camera = scene.film, scene.settings, scene.camera
    triangles = [len(mesh.triangles) for mesh in scene.meshes]
    lines = [f"{scene.name}, frame {scene.frame}"]
    spheres = sum(len(mesh.spheres) for mesh in scene.meshes if mesh.spheres is not None)
    points = f", {spheres:,} spheres" if spheres else ""
    lines.append(f"  meshes      {len(triangles)} with {sum(triangles):,} triangles{points}")
    if scene.instances is not None:
        mesh_of = np.array([o.mesh for o in scene.objects] or [0])
        seen = np.array(triangles or [0])[mesh_of[scene.instances.object]].sum() if len(scene.instances.object) else 0
        lines.append(
            f"  instances   {len(scene.instances.object):,} of {len(scene.objects)} objects: {seen:,} triangles"
        )
    lines.append(f"  materials   {', '.join(m.name for m in scene.materials) or 'none'}")
    pixels = sum(picture.pixels.nbytes for picture in scene.images)
    lines.append(f"  images      {len(scene.images)}, {pixels / 1e6:.1f} MB")
    kinds = [light.kind for light in scene.lights]
    lines.append(f"  lights      {', '.join(f'{kinds.count(k)} {k.lower()}' for k in sorted(set(kinds))) or 'none'}")
    lines.append(f"  world       {scene.world.name if scene.world else 'none'}")
    lines.append(f"  camera      {camera.kind.lower()}, {camera.lens_mm:g} mm{', depth of field' * camera.use_dof}")
    border = f", border {film.border}" if film.border else ""
    lines.append(
        f"  film        {film.width} x {film.height}{border}, {film.filter.lower()} {film.filter_width:g} pixels"
    )
    lines.append(f"  passes      {', '.join(film.passes)}")
    limit = f", at most {settings.time_limit:g} s" if settings.time_limit else ""
    lines.append(
        f"  sampling    {settings.samples} samples{limit}, seed {settings.seed}, {settings.max_bounces} bounces"
    )
    lines += [f"  warning     {warning}" for warning in scene.warnings]
    return lines
