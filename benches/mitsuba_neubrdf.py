"""A NeuBRDF as a BSDF of Mitsuba 3: what a researcher would write today to render one.

The network's weights are literals in the compiled kernel, which is the fastest that Dr.Jit offers on a CPU. Sampled as ours: with
one half by a GGX lobe of visible normals, with the other by the cosine.

The JSON file holds n_side, features, alpha, `wi` and `wo` (each with `codes`, codes x features, and `indices`, a code a grid point),
`layers` (each with `weights`, outputs x inputs, and `bias`), gain, scale and max. Grid points are numbered by rings from the pole, as
src/scene/brdf/sphere_grid.rs has it; a pixel's four corners count a quarter each.
"""
import json

import drjit as dr
import mitsuba as mi
import numpy as np

if mi.variant().startswith("cuda"):
    from drjit.cuda.ad import Array4f
else:
    from drjit.llvm.ad import Array4f


class NeuBrdf:
    def __init__(self, file):
        with open(file) as opened:
            data = json.load(opened)
        self.n_side, self.features = data["n_side"], data["features"]
        self.alpha, self.gain, self.scale, self.max = (data[key] for key in ("alpha", "gain", "scale", "max"))
        self.tables = [
            (mi.UInt32(np.array(data[key]["indices"], np.uint32)), mi.Float(np.array(data[key]["codes"], np.float32)))
            for key in ("wi", "wo")
        ]
        self.layers = [
            (np.array(layer["weights"], np.float32).reshape(len(layer["bias"]), -1).tolist(), layer["bias"])
            for layer in data["layers"]
        ]
        dr.eval(self.tables)

    def corners(self, w):
        """The four grid points around a direction."""
        n = self.n_side
        turned = dr.atan2(w.y, w.x) * (2 / dr.pi)
        turned = dr.select(turned < 0, turned + 4, turned)
        quadrant = dr.minimum(mi.UInt32(turned), 3)
        tau = turned - mi.Float(quadrant)
        sigma = dr.sqrt(dr.maximum(3 * (1 - w.z), 0))
        shift = 0.5 - 0.75 * w.z
        is_cap = sigma < 1
        a = n * dr.select(is_cap, tau * sigma, tau + shift)
        b = n * dr.select(is_cap, (1 - tau) * sigma, 1 - tau + shift)
        i = dr.minimum(mi.UInt32(a), 2 * n - 1)
        j = dr.minimum(mi.UInt32(b), 2 * n - 1 - i)
        east, west = self.index(quadrant, i + 1, j), self.index(quadrant, i, j + 1)
        is_triangle = i + j + 2 > 2 * n
        poleward = self.index(quadrant, i, j)
        return poleward, east, dr.select(is_triangle, poleward, west), dr.select(
            is_triangle, west, self.index(quadrant, i + 1, j + 1)
        )

    def index(self, quadrant, i, j):
        n = self.n_side
        ring = i + j
        place = quadrant * ring + i
        cap = 1 + 2 * ring * (ring - 1) + dr.select(place == 4 * ring, 0, place)
        place = (quadrant * n + i - ((ring - n) >> 1)) & (4 * n - 1)
        belt = 1 + 2 * n * (n - 1) + 4 * n * (ring - n) + place
        return dr.select(ring == 0, 0, dr.select(ring < n, cap, belt))

    def gather(self, table, w):
        indices, codes = table
        sums = [Array4f(0) for _ in range(self.features // 4)]
        for corner in self.corners(w):
            code = dr.gather(mi.UInt32, indices, corner)
            for part in range(len(sums)):
                sums[part] += dr.gather(Array4f, codes, code * len(sums) + part)
        return [0.25 * value for part in sums for value in part]

    def eval(self, towards_light, towards_viewer):
        x = self.gather(self.tables[0], towards_light) + self.gather(self.tables[1], towards_viewer)
        for number, (weights, bias) in enumerate(self.layers):
            outputs = []
            for row, start in zip(weights, bias):
                total = mi.Float(start)
                for weight, value in zip(row, x):
                    total = dr.fma(value, weight, total)
                outputs.append(total if number == len(self.layers) - 1 else dr.maximum(total, 0))
            x = outputs
        return mi.Color3f(*[dr.clip((dr.exp(self.scale * y) - 1) / self.gain, 0, self.max) for y in x])


class NeuBsdf(mi.BSDF):
    """In Mitsuba `si.wi` is towards the viewer and `wo` towards the light."""

    brdf = None

    def __init__(self, props):
        mi.BSDF.__init__(self, props)
        self.m_components = [mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide]
        self.m_flags = self.m_components[0]

    def lobe(self):
        return mi.MicrofacetDistribution(mi.MicrofacetType.GGX, self.brdf.alpha, True)

    def density(self, viewer, light):
        half = dr.normalize(viewer + light)
        lobe = self.lobe().pdf(viewer, half) / (4 * dr.maximum(dr.dot(light, half), 1e-6))
        return 0.5 * (mi.warp.square_to_cosine_hemisphere_pdf(light) + lobe)

    def sample(self, context, si, sample1, sample2, active):
        active = active & (mi.Frame3f.cos_theta(si.wi) > 0)
        normal, _ = self.lobe().sample(si.wi, sample2)
        light = dr.select(sample1 < 0.5, mi.warp.square_to_cosine_hemisphere(sample2), mi.reflect(si.wi, normal))
        active &= mi.Frame3f.cos_theta(light) > 0
        result = mi.BSDFSample3f()
        result.wo, result.eta = light, 1.0
        result.pdf = dr.select(active, self.density(si.wi, light), 0)
        result.sampled_type, result.sampled_component = mi.UInt32(+mi.BSDFFlags.GlossyReflection), 0
        active &= result.pdf > 0
        value = self.brdf.eval(light, si.wi) * (mi.Frame3f.cos_theta(light) / result.pdf)
        return result, dr.select(active, value, 0)

    def eval(self, context, si, light, active):
        active = active & (mi.Frame3f.cos_theta(si.wi) > 0) & (mi.Frame3f.cos_theta(light) > 0)
        return dr.select(active, self.brdf.eval(light, si.wi) * mi.Frame3f.cos_theta(light), 0)

    def pdf(self, context, si, light, active):
        active = active & (mi.Frame3f.cos_theta(si.wi) > 0) & (mi.Frame3f.cos_theta(light) > 0)
        return dr.select(active, self.density(si.wi, light), 0)

    def eval_pdf(self, context, si, light, active):
        return self.eval(context, si, light, active), self.pdf(context, si, light, active)

    def to_string(self):
        return "NeuBsdf[]"


def register(file):
    NeuBsdf.brdf = NeuBrdf(file)
    mi.register_bsdf("neubrdf", NeuBsdf)
