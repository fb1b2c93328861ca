"""The scene: plain dataclasses of arrays, what every exporter makes and every backend reads.

Nothing here knows Blender. Spaces: *object* is a mesh's own space, *world* is Blender's world minus
``Scene.origin`` (subtracted in double, so that far-away scenes keep their digits). Lengths are metres,
angles radians, colours scene-linear Rec.709. Matrices are rows of a 3x4 affine (float64).
``luch.scenefile`` writes a scene to one ``.luch`` file and reads it back.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from luch import integrators

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
U32 = NDArray[np.uint32]


def _identity() -> F64:
    return np.eye(3, 4)


@dataclass
class Attribute:
    """A named value on a mesh: float32 (n, channels 1..4), one row per element of its domain."""

    data: F32
    domain: str  # "POINT" (V rows), "CORNER" (3T rows), "FACE" (T rows), "MESH" (1 row), "SPHERE" (S rows);
    # of curves "CURVE" (C rows) and "CURVE_POINT" (P rows, mixed between neighbours)


@dataclass
class Curves:
    """Hair: Catmull-Rom curves through points; Settings.curve_shape says what they look like."""

    points: F32  # (P, 4) place and radius in object space
    first: U32  # (C,) first point of each curve, ascending from 0; it ends where the next begins. One point: not drawn
    material_slots: NDArray[np.uint16]  # (C,)
    motion_points: F32 | None = None  # (K, P, 4) while the shutter is open, as Mesh.motion_positions


@dataclass
class Mesh:
    """Triangles, spheres and curves in object space. Sphere k is primitive T + k and shows the first material; the pieces
    of curves' segments follow."""

    name: str
    positions: F32  # (V, 3)
    triangles: U32  # (T, 3)
    material_slots: NDArray[np.uint16]  # (T,)
    normals: F32 | None = None  # (V, 3) or (3T, 3) unit; None: every face is flat
    normals_domain: str = "NONE"  # "NONE", "POINT", "CORNER"
    attributes: dict[str, Attribute] = field(default_factory=dict)
    uv_active: str = ""  # attribute that Texture Coordinate > UV and an unnamed UV Map give
    color_active: str = ""  # attribute that an unnamed Color Attribute gives
    # Blender's texture space: generated = (p - location) / size / 2 + 1/2. An attribute named
    # "generated" (undeformed coordinates, already in 0..1) wins where it exists.
    texture_location: tuple[float, float, float] = (0.0, 0.0, 0.0)
    texture_size: tuple[float, float, float] = (1.0, 1.0, 1.0)
    # (S, 4) centre and radius, as point clouds have them: only their outside is seen. A radius of 0 is not drawn.
    spheres: F32 | None = None
    curves: Curves | None = None
    # Its shape while the shutter is open, at evenly spaced times; None: it keeps it. The fields above are those of the
    # shutter's middle.
    motion_positions: F32 | None = None  # (K, V, 3)
    motion_normals: F32 | None = None  # (K, rows of normals, 3), where it has normals
    displaced: bool = False  # by its materials, before it came here


@dataclass
class Object:
    """What instances of one Blender object share."""

    name: str
    mesh: int  # index into Scene.meshes
    materials: list[int]  # slot -> index into Scene.materials (an empty slot: the default material)
    pass_index: int = 0
    color: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    visibility: int = 63  # RayKind bits: camera 1, diffuse 2, glossy 4, transmission 8, volume 16, shadow 32
    holdout: bool = False
    shadow_catcher: bool = False
    lightgroup: str = ""
    # Values of the object itself that programs ask for as "object:NAME" or "instancer:NAME": red, green, blue, alpha.
    attributes: dict[str, tuple[float, float, float, float]] = field(default_factory=dict)
    # Cosine of the light with the surface below which shadow rays leave from the curved surface that smooth normals
    # speak of (Blender's Shadow Terminator > Geometry Offset); 0: never.
    shadow_terminator: float = 0.0
    asset: str = ""  # name for Cryptomatte Asset (the top of the parent chain)


@dataclass
class InstanceMotion:
    """Where instances stand while the shutter is open: those that move, M of them."""

    instance: U32  # (M,) rows of Instances
    keys: U32  # (M,) how many matrices each has, evenly spaced from the opening to the closing, at least 2
    matrix: F64  # (sum of keys, 3, 4) as Instances.matrix, instance by instance


@dataclass
class Instances:
    """One row per instance; N rows in every array."""

    object: U32  # (N,) index into Scene.objects
    matrix: F64  # (N, 3, 4) object to world, before Scene.origin is subtracted
    random: F32  # (N,) Object Info > Random, 0..1
    generated: F32  # (N, 3) instancer's generated coordinates
    uv: F32  # (N, 2) instancer's UV
    motion: InstanceMotion | None = None  # None: all stand still. matrix is that of the shutter's middle


@dataclass
class Program:
    """A shader program (see native/include/luch/shade/op.h), made by luch.shader.ProgramBuilder."""

    code: U32  # per instruction: op, param count, outputs, inputs, params
    constants: F32  # the first registers
    register_count: int
    flags: int  # ProgramFlag
    tables: F32  # ramps and curves; params hold offsets into it
    images: list[int]  # image slot of the program -> index into Scene.images
    attributes: list[str]  # attribute slot of the program -> attribute name
    aovs: list[str] = field(default_factory=list)


@dataclass
class Phase:
    """A part of a medium's scattering: how much, and by which phase function (native/include/luch/bsdf/phase.h)."""

    # "HENYEY_GREENSTEIN" (a: anisotropy), "DRAINE" (a: anisotropy, b: alpha), "FOURNIER_FORAND" (a: the particles'
    # index of refraction, b: share of the light that is scattered back).
    kind: str
    scattering: tuple[float, float, float]  # coefficient, per metre
    a: float = 0.0
    b: float = 0.0


@dataclass
class Medium:
    """What fills a volume, the same everywhere in it."""

    absorption: tuple[float, float, float] = (0.0, 0.0, 0.0)  # coefficient, per metre
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)  # radiance that a metre adds
    scattering: list[Phase] = field(default_factory=list)


@dataclass
class Material:
    name: str
    surface: Program
    pass_index: int = 0
    emission_sampling: str = "AUTO"  # "NONE", "AUTO", "FRONT", "BACK", "FRONT_BACK"
    transparent_shadows: bool = True
    emission_estimate: tuple[float, float, float] = (0.0, 0.0, 0.0)  # typical radiance, for choosing lights
    volume: Medium | None = None  # what lies behind the surface
    only_volume: bool = False  # there is no surface: rays pass as if it were not there


@dataclass
class Image:
    """Pixels, bottom row first. uint8 is sRGB-encoded or raw as colorspace says; float is scene-linear."""

    name: str
    pixels: NDArray[np.uint8] | NDArray[np.float16] | F32  # (H, W, 1..4)
    colorspace: str = "LINEAR"  # "LINEAR" (also Non-Color) or "SRGB"
    alpha: str = "STRAIGHT"  # "STRAIGHT", "PREMULTIPLIED", "CHANNEL_PACKED", "NONE"


@dataclass
class Light:
    """A lamp in Blender's terms; strength as Blender states it (W; sun W/m2)."""

    name: str
    kind: str  # "POINT", "SPOT", "SUN", "AREA"
    matrix: F64 = field(default_factory=_identity)  # (3, 4), shines along -Z
    color: tuple[float, float, float] = (1.0, 1.0, 1.0)  # colour x temperature x 2^exposure
    power: float = 10.0
    normalize: bool = True  # False: power is not divided by the area
    radius: float = 0.0  # point and spot, metres
    soft_falloff: bool = True
    spot_size: float = 0.785398  # full cone angle
    spot_blend: float = 0.15
    angle: float = 0.0  # sun, angular diameter
    shape: str = "SQUARE"  # area: "SQUARE", "RECTANGLE", "DISK", "ELLIPSE"
    size: float = 0.25
    size_y: float = 0.25
    spread: float = 3.14159265
    program: Program | None = None  # emission of the lamp's node tree; None: constant 1
    visibility: int = 62  # RayKind bits that see the lamp itself (camera off by default)
    cast_shadow: bool = True
    use_mis: bool = True
    max_bounces: int = 1024
    lightgroup: str = ""
    random: float = 0.0


@dataclass
class World:
    name: str
    program: Program
    visibility: int = 63
    sampling: str = "AUTOMATIC"  # importance map: "NONE", "AUTOMATIC", "MANUAL"
    map_resolution: int = 1024
    max_bounces: int = 1024
    lightgroup: str = ""
    volume: Medium | None = None  # everywhere, beside what volumes hold


@dataclass
class Shutter:
    """When it is open. Times of everything that moves run from 0, when it opens, to 1, when it closes."""

    length: float = 0.5  # frames
    position: str = "CENTER"  # the frame is its "START", "CENTER" or "END"
    curve: F32 | None = None  # (N,) how far it is open at evenly spaced times; None: alike all the time
    rolling: float | None = None  # share of the time that a line of pixels sees, the top line first; None: all see all
    still: list[str] = field(default_factory=list)  # what could move and is told not to, a fact each


@dataclass
class CameraMotion:
    """A camera while the shutter is open, at evenly spaced times."""

    matrix: F64  # (K, 3, 4) as Camera.matrix
    lens_mm: tuple[float, float] | None = None  # when the shutter opens and when it closes; None: does not change


PANORAMAS = (  # geometry of each: native/include/luch/camera/panorama.h
    "EQUIRECTANGULAR",
    "FISHEYE_EQUIDISTANT",
    "FISHEYE_EQUISOLID",
    "FISHEYE_POLYNOMIAL",
    "MIRROR_BALL",
    "CUBE_FACE",
    "CYLINDER",
)


@dataclass
class Camera:
    kind: str = "PERSP"  # "PERSP", "ORTHO" or one of PANORAMAS
    matrix: F64 = field(default_factory=_identity)  # (3, 4) camera to world, looks along -Z, Y up
    lens_mm: float = 50.0
    sensor_width_mm: float = 36.0
    sensor_height_mm: float = 24.0
    sensor_fit: str = "AUTO"  # "AUTO", "HORIZONTAL", "VERTICAL"
    ortho_scale: float = 6.0
    shift_x: float = 0.0
    shift_y: float = 0.0
    clip_start: float = 0.1
    clip_end: float = 1000.0
    use_dof: bool = False
    focus_distance: float = 10.0
    fstop: float = 2.8
    blades: int = 0
    blades_rotation: float = 0.0
    aperture_ratio: float = 1.0
    latitude: tuple[float, float] = (-1.5707964, 1.5707964)
    longitude: tuple[float, float] = (-3.1415927, 3.1415927)
    fisheye_fov: float = 3.1415927  # of all fisheyes, radians
    fisheye_lens_mm: float = 10.5  # FISHEYE_EQUISOLID
    fisheye_polynomial: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)  # panorama.h, r in mm
    cylinder_angle: tuple[float, float] = (-3.1415927, 3.1415927)  # CYLINDER, left to right
    cylinder_height: tuple[float, float] = (-1.0, 1.0)  # on a cylinder of radius 1
    motion: CameraMotion | None = None  # None: stands still. matrix and lens are those of the shutter's middle


@dataclass
class Film:
    width: int = 1920  # full frame, pixels (after resolution percentage)
    height: int = 1080
    border: tuple[int, int, int, int] | None = None  # x0, y0, x1, y1 in pixels, bottom left origin
    pixel_aspect: tuple[float, float] = (1.0, 1.0)
    filter: str = "BLACKMAN_HARRIS"  # "BOX", "GAUSSIAN", "BLACKMAN_HARRIS"
    filter_width: float = 1.5
    exposure: float = 1.0
    transparent: bool = False
    transparent_glass: bool = False
    transparent_roughness: float = 0.1
    alpha_threshold: float = 0.5  # of data passes through transparency
    mist: tuple[float, float, str] = (0.0, 25.0, "QUADRATIC")  # start, depth, falloff
    passes: list[str] = field(default_factory=lambda: ["Combined"])  # Blender's pass names
    cryptomatte_depth: int = 6
    lightgroups: list[str] = field(default_factory=list)
    aovs: list[tuple[str, str]] = field(default_factory=list)  # (name, "COLOR" or "VALUE")

    @property
    def size(self) -> tuple[int, int]:
        """Pixels that are rendered, across and up: of the border, if there is one."""
        x0, y0, x1, y1 = self.border or (0, 0, self.width, self.height)
        return x1 - x0, y1 - y0

    @property
    def pixels(self) -> int:
        """How many are rendered."""
        width, height = self.size
        return width * height


@dataclass
class Settings:
    """What trades accuracy for time. Defaults take nothing away from the light."""

    samples: int = 128
    time_limit: float = 0.0  # seconds with building and writing of the film, 0: none
    error_limit: float = 0.0  # the render ends when its error is that small (luch.accuracy), 0: none
    adaptive: bool = False  # until that error: more samples where the error is (luch.adaptive)
    seed: int = 0
    sampler: str = "SOBOL"  # a name of luch.samplers
    # Several renders of one seed, each with samples of its own, merge into one (luch.merge).
    first_sample: int = 0
    samples_in_all: int = 0  # of all those renders; 0: no others follow
    mergeable: bool = False  # the result keeps the film's sums
    verify: bool = False  # two halves of other seeds, held against each other (luch.verify)
    threads: int = 0  # 0: all
    max_bounces: int = 12
    diffuse_bounces: int = 4
    glossy_bounces: int = 4
    transmission_bounces: int = 12
    volume_bounces: int = 0
    transparent_bounces: int = 8
    min_light_bounces: int = 0
    min_transparent_bounces: int = 0
    clamp_direct: float = 0.0
    clamp_indirect: float = 0.0
    filter_glossy: float = 0.0
    caustics_reflective: bool = True
    caustics_refractive: bool = True
    light_tree: bool = True
    light_sampling_threshold: float = 0.01
    accelerator: str = "AUTO"  # or a kind of luch.accel
    precision: str = "WATERTIGHT"  # "FAST", "DOUBLE"
    curve_shape: str = "RIBBON"  # turned to each ray, shaded as if round; or "THICK" (round), "THICK_LINEAR" (cones)
    curve_subdivisions: int = 2  # a ribbon is straight in 2**n pieces of a segment, n at most 4
    integrator: str = "PATH"  # a name of luch.integrators
    device: str = "CPU"  # or "CUDA"
    texture_memory: float = 0.0  # MB of images on each GPU, 0: what fits; the rest is read from the host's memory
    gpus: int = 0  # how many of the CUDA devices that are visible, 0: all
    # CUDA: kernels are compiled for the scene while those for all scenes begin it. False: the latter alone, where they
    # serve; the same picture, more slowly.
    own_kernels: bool = True
    # To see what an effect (luch.effects) costs: left out of the picture; simulated though the scene lacks it. ["ALL"]
    # forces every effect that can be.
    without_effects: list[str] = field(default_factory=list)
    force_effects: list[str] = field(default_factory=list)
    estimate_error: bool = True  # keep marks in the film, whose differences tell the picture's error
    denoise: bool = False  # Combined goes through Open Image Denoise (luch.denoise)
    # One dial instead of the above (luch.quality): "CUSTOM" leaves them, the others choose on the scene's own curve.
    quality: str = "CUSTOM"
    quality_report: str = ""  # a report.json that the dial chooses by; "": a pilot before the render
    ao_distance: float = 10.0  # Ambient Occlusion pass; Blender's world.light_settings.distance

    def bounces(self, kind: str) -> int:
        """How many bounces of a kind ("diffuse", "volume", ...) the integrator follows. ValueError: it is unknown."""
        limit: int = getattr(self, f"{kind}_bounces")
        return 0 if kind in integrators.named(self.integrator).ends_at else limit

    @property
    def photon_maps(self) -> bool:
        """Whether the integrator brings caustics by photons. ValueError: it is unknown."""
        return integrators.named(self.integrator).photons


@dataclass
class Scene:
    name: str = "Scene"
    meshes: list[Mesh] = field(default_factory=list)
    objects: list[Object] = field(default_factory=list)
    instances: Instances | None = None
    materials: list[Material] = field(default_factory=list)
    images: list[Image] = field(default_factory=list)
    lights: list[Light] = field(default_factory=list)
    world: World | None = None
    camera: Camera = field(default_factory=Camera)
    film: Film = field(default_factory=Film)
    settings: Settings = field(default_factory=Settings)
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)  # subtracted from every position in double
    frame: int = 1
    shutter: Shutter | None = None  # None: the picture is of an instant, and nothing moves
    warnings: list[str] = field(default_factory=list)  # one sentence each: object, fact, remedy
    # What the exporter met and Luch does not draw yet: name of an effect (luch.effects) -> its warnings.
    unsupported: dict[str, list[str]] = field(default_factory=dict)
