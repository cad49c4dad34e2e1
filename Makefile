# Everything a user types. Each target installs what it needs first; nothing is done twice.

CARGO := cargo
FEATURES := --features embree --locked
OUT := target/demo

.PHONY: demo test test-device soak bench check study study-fit study-share study-sparse study-layered study-mosaic gallery install install-test install-demo

## Renders the preview scene, in analytic and in neural materials, to target/demo/preview.png and neural.png (and .exr).
demo: install-demo
	$(CARGO) build --release $(FEATURES)
	mkdir -p $(OUT)
	target/release/neubrdf render scenes/preview/scene.toml --size 512x512 --spp 128 -o $(OUT)/preview.exr --png $(OUT)/preview.png
	target/release/neubrdf render scenes/preview/neural.toml --size 512x512 --spp 128 -o $(OUT)/neural.exr --png $(OUT)/neural.png
	@echo "Look at $(OUT)/preview.png and $(OUT)/neural.png"

## Runs every test: two Vulkan drivers, the validation layers, and the Embree reference.
test: install-test
	$(CARGO) test $(FEATURES)

## Runs the tests of kernels and pictures on a device of your own in lavapipe's place: a part of its name.
DEVICE := llvmpipe
test-device: install-test
	NEUBRDF_TEST_DEVICE=$(DEVICE) $(CARGO) test $(FEATURES) --test gpu --test traversal --test bsdf --test neubrdf_device \
		--test render --test truth --test stability --test proof --test normal_map --test roughness_map --test direction_map --test emission_texture \
		--test opacity --test path_reuse --test texture_placement --test patches --test plugin --test plugin_calls --test host_meshes

## The tests of the plugin that take long: 10,000 frames with changes, and 1,000 renderers made and dropped; under the validation
## layer, and without it, as its own books grow.
soak: install-test
	NEUBRDF_FRAMES=10000 NEUBRDF_ROUNDS=1000 $(CARGO) test $(FEATURES) --test plugin -- --nocapture --test-threads 1 soak rounds
	NEUBRDF_NO_VALIDATION=1 NEUBRDF_FRAMES=10000 NEUBRDF_ROUNDS=1000 \
		$(CARGO) test $(FEATURES) --test plugin -- --nocapture --test-threads 1 soak rounds

## Formatting, lints, documentation and SPIR-V, as CI holds them.
check: install-test
	$(CARGO) fmt --check
	$(CARGO) clippy --all-targets $(FEATURES) -- -D warnings
	$(CARGO) clippy --no-default-features --all-targets --locked -- -D warnings
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc --no-deps $(FEATURES)
	for module in spirv/*.spv; do spirv-val --target-env vulkan1.2 --scalar-block-layout $$module || exit 1; done

## Measures, in about ten minutes, and prints the tables of docs/performance.md. With MITSUBA_PYTHON set, beside Mitsuba
## (without it, it says how to get that). The long ones, each ten to twenty minutes more:
##   make bench RAYS=--scaling     builds spheres of 10^3 to 10^7 triangles
##   make bench SECTIONS=error     time to an error, against references of REFERENCE_SPP samples a pixel (4096)
##   make bench SECTIONS=sphere    the same for a ball of NeuBRDF
## SECTIONS takes any of: cornell passes cold memory neubrdf error sphere. `cargo bench --features embree --bench sampling` prints the variance of
## sampling measured materials.
RAYS :=
SECTIONS := cornell passes cold memory
bench: install-test
	$(CARGO) bench $(FEATURES) --bench rays -- $(RAYS)
	$(CARGO) bench $(FEATURES) --bench render -- $(SECTIONS)

## Fits every published network and our own surfaces, and prints the table of docs/fits.md: about half a minute a material on two
## cores. It goes on where it was stopped. MATERIALS restricts it: names, `published`, `ours`; QUALITY is draft, default or best;
## RECIPES are set side by side: default, paper, unquantised, with commas between.
MATERIALS :=
QUALITY := default
RECIPES := default
study-fit:
	$(CARGO) run --release $(FEATURES) --example study_fit -- --quality $(QUALITY) --recipe $(RECIPES) $(MATERIALS)

## Fits groups of 1, 2, 4 … 64 of MERL's materials that share a codebook a hemisphere, and prints and draws (target/study-share/sharing.svg) what that
## costs. It goes on where it was stopped.
study-share:
	$(CARGO) run --release $(FEATURES) --example study_share

## Fits a few materials with NeuBRDFs of several sizes, times each on the device, and prints and draws (target/study/study.svg) which
## are worth their time. It goes on where it was stopped. STUDY_QUALITY is that of the fits; MATERIALS are names as above.
STUDY_QUALITY := draft
study: install-demo
	$(CARGO) run --release $(FEATURES) --example study_model -- --quality $(STUDY_QUALITY) $(MATERIALS)

## Installs the program (with the Embree reference), the C library (without), its header, pkg-config file and CMake module.
PREFIX := /usr/local
install: install-demo
	$(CARGO) build --release $(FEATURES) --bin neubrdf --target-dir target/install
	$(CARGO) rustc --release --locked --lib --crate-type cdylib,staticlib --target-dir target/install
	scripts/install.sh $(PREFIX) target/install/release

## Learns six materials from few measurements, and sets what comes out beside the nearest of them and their mean by distance; about two
## minutes. It goes on where it was stopped.
study-sparse:
	$(CARGO) run --release $(FEATURES) --example study_sparse -- $(MATERIALS)

## Renders each material that is shipped, simulated and as its NeuBRDF, to target/gallery/materials.png.
gallery: install-demo
	$(CARGO) run --release $(FEATURES) --example gallery

## Renders the preview scene in layers that light walks through at random and in the NeuBRDFs that learned them: time against error.
study-layered: install-test
	$(CARGO) run --release $(FEATURES) --bin neubrdf -- converge --study scenes/preview/layered_study.toml -o $(OUT)/study-layered --resume

## Renders the mosaic in the maps that its NeuBRDF learned, and in the NeuBRDF: time against error, and how far the two are apart.
study-mosaic: install-test
	$(CARGO) run --release $(FEATURES) --bin neubrdf -- converge --study scenes/mosaic/study.toml -o $(OUT)/study-mosaic --resume

install-demo:
	@scripts/setup.sh demo

install-test:
	@scripts/setup.sh test
