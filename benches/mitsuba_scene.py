"""A scene rendered by Mitsuba 3 on request: what benches/render compares with.

Usage: MITSUBA_VARIANT=llvm_ad_rgb|cuda_ad_rgb|scalar_rgb python mitsuba_scene.py cornell SIDE
       MITSUBA_VARIANT=llvm_ad_rgb|cuda_ad_rgb            python mitsuba_scene.py SPHERE.json SIDE

`cornell` is Mitsuba's own Cornell box, mi.cornell_box(). A JSON file is a NeuBRDF, as benches/render/sphere.rs writes it, on a
sphere over a grey ground; mitsuba_neubrdf.py evaluates it.

SIDE x SIDE pixels, path tracer of depth 6, box filter as ours. Each line on standard input is answered by one line of JSON:
    render SAMPLER SPP SEED          seconds
    error SAMPLER SPP SEED           seconds, relmse against the reference, the reference's own noise taken off
    reference SPP FILE               makes the reference of `error` in two halves, or reads it from FILE
"""
import json
import os
import sys
import tempfile
import time

# A kernel cache of our own: the first render compiles, as a user's first does.
cache = tempfile.TemporaryDirectory()
os.environ["HOME"] = cache.name

import mitsuba as mi
import numpy as np

mi.set_variant(os.environ.get("MITSUBA_VARIANT", "llvm_ad_rgb"))


def sphere(file):
    import mitsuba_neubrdf

    mitsuba_neubrdf.register(file)
    to_world = mi.ScalarTransform4f
    grey = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.5}}
    lamp = {"type": "area", "radiance": {"type": "rgb", "value": 12.0}}
    return {
        "type": "scene",
        "sensor": {
            "type": "perspective",
            "fov": 40,
            "to_world": to_world().look_at([0, -4, 1.6], [0, 0, 0.8], [0, 0, 1]),
            "film": {"type": "hdrfilm"},
        },
        "ball": {"type": "sphere", "center": [0, 0, 1], "bsdf": {"type": "neubrdf"}},
        "ground": {"type": "rectangle", "to_world": to_world().scale(20), "bsdf": grey},
        "sky": {"type": "constant", "radiance": {"type": "rgb", "value": 0.5}},
        "lamp": {
            "type": "rectangle",
            "to_world": to_world().translate([1.5, -1, 4]) @ to_world().rotate([1, 0, 0], 180) @ to_world().scale(0.7),
            "emitter": lamp,
        },
    }


def load(sampler):
    scene = mi.cornell_box() if sys.argv[1] == "cornell" else sphere(sys.argv[1])
    scene["integrator"] = {"type": "path", "max_depth": 6}
    side = int(sys.argv[2])
    scene["sensor"]["film"] |= {"width": side, "height": side, "rfilter": {"type": "box"}}
    scene["sensor"]["sampler"] = {"type": sampler}
    return mi.load_dict(scene)


scenes = {}


def render(sampler, spp, seed):
    if sampler not in scenes:
        scenes[sampler] = load(sampler)
    # A GPU lowers its clocks between tasks: `warm_up` of src/converge/clock.rs.
    warm = time.perf_counter() + (0.5 if mi.variant().startswith("cuda") else 0.0)
    while time.perf_counter() < warm:
        np.array(mi.render(scenes[sampler], spp=spp, seed=seed + 100_000))
    start = time.perf_counter()
    picture = np.array(mi.render(scenes[sampler], spp=spp, seed=seed))
    return picture, time.perf_counter() - start


def make_reference(spp):
    """Two halves of independent samples, each in passes that fit in memory."""
    passes = max(spp // 256 // 2, 1)
    return [
        np.mean([render("independent", spp // passes // 2, 1000 + half * passes + i)[0] for i in range(passes)], axis=0)
        for half in range(2)
    ]


def rel_mse(difference, reference):
    return float(np.mean(difference**2 / (reference**2 + 0.01)))


reference = noise = None
print(json.dumps({"version": mi.__version__, "variant": mi.variant()}), flush=True)
for line in sys.stdin:
    command, *words = line.split()
    if command == "reference":
        spp, file = int(words[0]), words[1]
        if not os.path.exists(file):
            np.save(file, make_reference(spp))
        halves = np.load(file)
        reference = halves.mean(axis=0)
        noise = rel_mse((halves[0] - halves[1]) / 2, reference)
        answer = {"noise": noise, "mean": float(reference.mean())}
    else:
        picture, seconds = render(words[0], int(words[1]), int(words[2]))
        answer = {"seconds": seconds}
        if command == "error":
            answer["relmse"] = rel_mse(picture - reference, reference) - noise
    print(json.dumps(answer), flush=True)
