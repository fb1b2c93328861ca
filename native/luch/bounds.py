"""Constants of Python's that decide what a picture shows, with their reasons: docs/numerics.md derives them.

Those of the first part are the core's (``native/include/luch/math/bounds.h``, where the reasons stand): what is known
before a scene is built must be told by the same rule. A test holds them equal.
"""

LOBE_WEIGHT_CUTOFF = 1e-5
FILM_MIN_THICKNESS_NM = 0.1
SHARPEST_PHASE = 0.999
SMALLEST_HALF_SUN = 1e-6  # radians
SMALLEST_RADIUS = 1e-8  # metres

# -- Python's own ----------------------------------------------------------------------------------

# Diameter of a sky's sun, radians: a tenth of ours. Smaller ones are below a texel of any map that shows them.
SMALLEST_SKY_SUN = 0.0005
# Corners whose normals differ from their face's by no more, in any coordinate, are flat: 0.006 degrees, what normals
# in single precision and Blender's 16 bits a coordinate leave of a plane.
FLAT_CORNER = 1e-4
# A Texture Mapping divides by its scale; Blender keeps it from 0 by as much.
LEAST_MAPPING_SCALE = 1e-5
# Radius of a central cylindrical camera, by which its heights are divided: metres.
LEAST_CYLINDER_RADIUS = 1e-9
# Of the shape of hair: at 1 its exponent would have no end.
LEAST_HAIR_SHAPE = 1e-6
