"""Evaluates a .bsdf file with Mitsuba's `measured` plugin: measured.py FILE < pairs > values.

A line of input is wo and wi, of output f(wo, wi) cos(theta_i), RGB.
"""

import sys

import mitsuba as mi

mi.set_variant("scalar_rgb")
bsdf = mi.load_dict({"type": "measured", "filename": sys.argv[1]})
surface = mi.SurfaceInteraction3f()
for line in sys.stdin:
    x, y, z, *wi = map(float, line.split())
    surface.wi = mi.Vector3f(x, y, z)
    print(*bsdf.eval(mi.BSDFContext(), surface, mi.Vector3f(*wi)))
