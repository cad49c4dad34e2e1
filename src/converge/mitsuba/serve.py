"""Renders a scene by Mitsuba 3 on request. Usage: MITSUBA_VARIANT=llvm_ad_rgb python serve.py SCENE.xml

Each line on standard input, `SPP SEED FILE`, is answered by a line of JSON with the seconds of the render alone; the picture is in FILE,
as f32 RGB from the top left. The first line that is written says which version this is.
"""
import json
import os
import signal
import sys
import time

import mitsuba as mi
import numpy as np

# Ctrl-C in a terminal is for whoever asks; without them the input ends.
signal.signal(signal.SIGINT, signal.SIG_IGN)
mi.set_variant(os.environ.get("MITSUBA_VARIANT", "llvm_ad_rgb"))
scene = mi.load_file(sys.argv[1])
width, height = (int(side) for side in scene.sensors()[0].film().crop_size())
# Paths in flight: what fits in memory.
most = max(1, (1 << 23) // (width * height))
print(json.dumps({"version": mi.__version__, "variant": mi.variant()}), flush=True)
for line in sys.stdin:
    spp, seed, file = line.split(maxsplit=2)
    spp, seed, seconds, picture = int(spp), int(seed), 0.0, 0.0
    done = 0
    # A GPU lowers its clocks between tasks: `warm_up` of src/converge/clock.rs.
    warm = time.perf_counter() + (0.5 if mi.variant().startswith("cuda") else 0.0)
    while time.perf_counter() < warm:
        np.array(mi.render(scene, spp=min(most, spp), seed=2**32 - 1 - seed % 2**31))
    while done < spp:
        count = min(most, spp - done)
        start = time.perf_counter()
        # The seed of a pass: no two of a study are the same.
        part = np.array(mi.render(scene, spp=count, seed=(seed * 65537 + done) % 2**32))
        seconds += time.perf_counter() - start
        picture = picture + part * (count / spp)
        done += count
    picture.astype("<f4").tofile(file.strip())
    print(json.dumps({"seconds": seconds}), flush=True)
