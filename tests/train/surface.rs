//! Materials that vary over a texture: maps, samples and stacks of images to learn them from.

use std::f32::consts::PI;
use std::fs;
use std::path::Path;

use glam::{DVec2, DVec3, Vec2, Vec3};
use neubrdf::material::{Bsdf, Evaluate, Ggx, Prepared, TexelSamples, VaryingSurface};
use neubrdf::scene::brdf::{Footprint, NeuBrdf, SurfaceGrid, SurfaceSamples};
use neubrdf::scene::{Btf, Color, Fresnel, Surface, SurfaceMaps, Texture};
use neubrdf::train::check::{Check, check};
use neubrdf::train::measure::{Query, pair_errors_at};
use neubrdf::train::{Evaluator, GroundTruth, Pair, Plan, Recipe, Session, SurfacePlan, btf_pairs, sample_pairs};

use super::{finish, maps, small};

/// The mean |Δ ln(1 + f)| of a fit to a ground truth at a size of footprint, as large as so many texels.
fn error_at(evaluator: &Evaluator, truth: &dyn Evaluate, texels: f64, side: u32) -> f64 {
    let with = |queries: &[Query], texels: f64| -> Vec<Query> {
        let area = texels / f64::from(side * side);
        queries.iter().map(|query| Query { footprint: Footprint { area, ..query.footprint }, ..*query }).collect()
    };
    let fit = |queries: &[Query]| evaluator.eval_at(&with(queries, texels));
    // A texel's worth has been averaged by the maps themselves.
    let truth = |queries: &[Query]| -> Vec<DVec3> {
        let at = |query: &Query| truth.eval_at(query.footprint, query.wo, query.wi);
        with(queries, texels - 1.0).iter().map(at).collect()
    };
    pair_errors_at(2000, 3, &fit, &truth).log
}

/// Tiles of metal: points of them, and averages over larger and larger footprints, up to all of it.
#[test]
fn a_material_that_varies_is_learned_at_all_sizes() {
    const SIDE: u32 = 8;
    let tiles = VaryingSurface::new(maps::tiles(SIDE, 0.0));
    let plan = Plan { n_side: [8; 2], steps: 1500, pairs: 1 << 16, ..small(Recipe::Default) }.over([SIDE; 2]);
    let mut session = Session::new(plan, &GroundTruth::Surface { brdf: &tiles }).unwrap();
    let evaluator = Evaluator::neubrdf(&NeuBrdf::decode(&finish(&mut session)).unwrap());
    for level in [0.0, 1.0, 2.0, 3.0] {
        let error = error_at(&evaluator, &tiles, 4f64.powf(level), SIDE);
        assert!(error < 0.05, "level {level}: mean |Δ ln(1 + f)| {error}");
    }
}

/// A surface whose frames nobody is told.
#[derive(Debug)]
struct Unframed(VaryingSurface);

impl Evaluate for Unframed {
    fn eval(&self, wo: DVec3, wi: DVec3) -> DVec3 {
        self.0.eval(wo, wi)
    }

    fn eval_at(&self, footprint: Footprint, wo: DVec3, wi: DVec3) -> DVec3 {
        self.0.eval_at(footprint, wo, wi)
    }

    fn is_spatial(&self) -> bool {
        true
    }

    fn is_isotropic(&self) -> bool {
        self.0.is_isotropic()
    }
}

fn trained(truth: &dyn Evaluate, side: u32) -> NeuBrdf {
    let plan = Plan { n_side: [8; 2], steps: 1500, pairs: 1 << 16, ..small(Recipe::Default) }.over([side; 2]);
    let mut session = Session::new(plan, &GroundTruth::Surface { brdf: truth }).unwrap();
    NeuBrdf::decode(&finish(&mut session)).unwrap()
}

/// Tiles that lean up to 29°: at points a network with frames has nothing more to learn than about flat ones. Averages over several tiles it
/// learns as well as without. (In between, where texels are half as large as the tiles' bulges, no look-up tells one flank from the other.)
#[test]
fn normals_are_turned_into_and_not_learned() {
    const SIDE: u32 = 8;
    let tiles = VaryingSurface::new(maps::tiles(SIDE, 0.4));
    let brdf = trained(&tiles, SIDE);
    let surface = brdf.surface.as_ref().unwrap();
    assert!(brdf.is_isotropic && !surface.frames.normals.is_empty() && surface.frames.directions.is_empty());
    let evaluator = Evaluator::neubrdf(&brdf);
    let errors = [0.0, 1.0, 2.0, 3.0].map(|level| error_at(&evaluator, &tiles, 4f64.powf(level), SIDE));
    let unframed = trained(&Unframed(VaryingSurface::new(maps::tiles(SIDE, 0.4))), SIDE);
    let evaluator_of_unframed = Evaluator::neubrdf(&unframed);
    let before = [0.0, 1.0, 2.0, 3.0].map(|level| error_at(&evaluator_of_unframed, &tiles, 4f64.powf(level), SIDE));
    eprintln!("with frames {errors:.4?}, without {before:.4?}");
    assert!(errors[0] < 0.03 && before[0] > 0.06, "{errors:?} {before:?}");
    assert!(errors[2..].iter().all(|error| *error < 0.05), "{errors:?}");

    // What is fast is what is defined, and a BRDF.
    let mut random = Stream(1);
    for query in (0..300).map(|_| random.query()) {
        let (fast, exact) = (evaluator.eval_at(&[query])[0], brdf.eval_at(query.footprint, query.wo, query.wi));
        assert!((fast - exact).abs().max_element() <= 1e-4 * (exact.max_element() + 0.01), "{fast} {exact}");
    }
    // On the flank of a tile.
    let steep = Footprint::point(DVec2::splat(0.0625));
    let at = |pairs: &[[DVec3; 2]]| {
        evaluator
            .eval_at(&pairs.iter().map(|[wo, wi]| Query { footprint: steep, wo: *wo, wi: *wi }).collect::<Vec<_>>())
    };
    let frame = brdf.surface.as_ref().and_then(|surface| surface.frame(steep)).unwrap();
    let Check { negative, non_finite, max_albedo, reciprocity_error, .. } = check(false, frame, &at);
    assert!((negative, non_finite) == (0, 0) && max_albedo < 1.01, "{max_albedo}");
    assert!(reciprocity_error < 0.1, "{reciprocity_error}");
}

/// A brushed metal whose brush goes once around across the texture.
fn brushed(side: u32) -> SurfaceMaps {
    let fresnel = Fresnel::Schlick { f0: Color::constant(Vec3::splat(0.8)) };
    let direction = maps::texture(side, |at| {
        let (sin, cos) = (2.0 * PI * at.x).sin_cos();
        Vec3::new(0.5 + 0.5 * cos, 0.5 + 0.5 * sin, 0.0)
    });
    SurfaceMaps {
        surface: Surface::Conductor { fresnel, alpha: Vec2::new(0.5, 0.2) },
        color: None,
        roughness: None,
        normal: None,
        direction: Some(direction),
    }
}

#[test]
fn directions_of_anisotropy_are_turned_into_and_not_learned() {
    const SIDE: u32 = 16;
    let truth = VaryingSurface::new(brushed(SIDE));
    let brdf = trained(&truth, SIDE);
    let surface = brdf.surface.as_ref().unwrap();
    assert!(!brdf.is_isotropic && surface.frames.normals.is_empty() && !surface.frames.directions.is_empty());
    let error = |brdf: &NeuBrdf| error_at(&Evaluator::neubrdf(brdf), &truth, 1.0, SIDE);
    let errors = [error(&brdf), error(&trained(&Unframed(VaryingSurface::new(brushed(SIDE))), SIDE))];
    eprintln!("with frames, and without {errors:.4?}");
    assert!(errors[0] < 0.02 && errors[1] > 0.04, "{errors:?}");
}

/// Texels' codes, their scores and a network that is pruned on the way are all part of what is saved.
#[test]
fn a_resumed_training_over_a_texture_ends_as_an_uninterrupted_one() {
    let tiles = VaryingSurface::new(maps::tiles(8, 0.0));
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("state");
    for recipe in [Recipe::Default, Recipe::Paper] {
        let plan = Plan { pruned: 16, codes: [16; 2], batch: 256, hidden: 32, steps: 60, recipe, ..small(recipe) };
        let plan = plan.over([8; 2]);
        let plan = Plan { surface: plan.surface.map(|surface| SurfacePlan { codes: 20, ..surface }), ..plan };
        let start = || Session::new(plan.clone(), &GroundTruth::Surface { brdf: &tiles }).unwrap();
        let whole = finish(&mut start());
        assert_eq!(NeuBrdf::decode(&whole).unwrap().surface.unwrap().codebook.code_count(), 20);
        for stop in [13, 50] {
            let mut session = start();
            session.run(stop);
            session.save(&path).unwrap();
            let mut resumed = start();
            resumed.restore(&path).unwrap();
            assert!(finish(&mut resumed) == whole, "{recipe:?} from step {stop}");
        }
    }
}

fn save(path: &Path, texture: &Texture, code: impl Fn(f32) -> f32) {
    let byte = |number: half::f16| (255.0 * code(number.to_f32())).round() as u8;
    let pixels = texture.texels.iter().flat_map(|[r, g, b, _]| [*r, *g, *b].map(byte)).collect();
    image::RgbImage::from_raw(texture.width, texture.height, pixels).unwrap().save(path).unwrap();
}

/// IEC 61966-2-1.
fn srgb(linear: f32) -> f32 {
    if linear <= 0.0031308 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

#[test]
fn maps_are_read_as_they_are_meant() {
    let folder = tempfile::tempdir().unwrap();
    let SurfaceMaps { color, roughness, normal, .. } = maps::tiles(8, 0.3);
    save(&folder.path().join("color.png"), &color.unwrap(), srgb);
    save(&folder.path().join("roughness.png"), &roughness.unwrap(), |code| code);
    save(&folder.path().join("normal.png"), &normal.unwrap(), |code| code);
    let path = folder.path().join("tiles.toml");
    let write = |text: &str| fs::write(&path, text).unwrap();
    let load = || SurfaceMaps::load(&path).map(Option::unwrap).map_err(|error| error.to_string());

    let whole = "type = \"conductor\"\nf0 = 1\ntexture = \"color.png\"\nroughness_map = \"roughness.png\"\n";
    write(&format!("{whole}normal_map = \"normal.png\"\n"));
    let bumpy = VaryingSurface::new(load().unwrap().0);
    let made = VaryingSurface::new(maps::tiles(8, 0.3));
    assert!(!bumpy.is_isotropic() && bumpy.is_spatial() && bumpy.size() == [8, 8]);
    for i in 0..64 {
        let uv = DVec2::new(f64::from(i % 8) + 0.5, f64::from(i / 8) + 0.5) / 8.0;
        let [read, made] = [&bumpy, &made].map(|surface| surface.frame(Footprint::point(uv)).unwrap());
        assert!(read.normal.distance(made.normal) < 0.02 && read.doubled == DVec2::X, "{uv}");
    }

    // Without bumps it is at each texel the metal of that colour and roughness.
    write(whole);
    let flat = VaryingSurface::new(load().unwrap().0);
    assert!(flat.is_isotropic() && flat.frame(Footprint::WHOLE).is_none());
    let (wo, wi) = (DVec3::new(0.3, 0.1, 0.9).normalize(), DVec3::new(-0.2, 0.3, 0.8).normalize());
    let maps = maps::tiles(8, 0.0);
    let Surface::Conductor { fresnel, .. } = maps.surface else { panic!("tiles are of metal") };
    let sample = |map: &Option<Texture>, uv: Vec2| map.as_ref().unwrap().sample(uv);
    for uv in [Vec2::splat(0.0625), Vec2::new(0.3125, 0.8125)] {
        let alpha = sample(&maps.roughness, uv).truncate().powf(2.0);
        let metal = Prepared::Conductor { fresnel, roughness: Ggx::new(alpha) };
        let expected = Bsdf::new(&metal, sample(&maps.color, uv).as_dvec3()).eval(wo, wi);
        let found = flat.eval_at(Footprint::point(uv.as_dvec2()), wo, wi);
        assert!(((found - expected) / expected).abs().max_element() < 0.03, "{found} {expected}");
    }

    // Where the direction is across u, the roughness along u is that across v; a direction and its opposite are one.
    let across = |red: f32, green: f32| maps::texture(8, |_| Vec3::new(red, green, 0.0));
    let stretched = "type = \"conductor\"\nf0 = 1\nalpha = [0.4, 0.1]\nanisotropy_direction_map = \"direction.png\"\n";
    let swapped = Prepared::Conductor { fresnel, roughness: Ggx::new(Vec2::new(0.1, 0.4)) };
    for (red, green) in [(0.5, 1.0), (0.5, 0.0)] {
        save(&folder.path().join("direction.png"), &across(red, green), |code| code);
        write(stretched);
        let turned = VaryingSurface::new(load().unwrap().0);
        assert!(!turned.is_isotropic() && turned.frame(Footprint::WHOLE).is_some());
        let expected = Bsdf::new(&swapped, DVec3::ONE).eval(wo, wi);
        let found = turned.eval_at(Footprint::point(DVec2::splat(0.3)), wo, wi);
        assert!(((found - expected) / expected).abs().max_element() < 0.02, "{found} {expected}");
    }

    write("type = \"conductor\"\nmetal = \"gold\"\nalpha = 0.2\n");
    assert!(SurfaceMaps::load(&path).unwrap().is_none());
    for (text, message) in [
        ("type = \"woven\"\nroughness_map = \"roughness.png\"\n", "warp"),
        ("type = \"diffuse\"\nroughness_map = \"roughness.png\"\n", "no map of roughness on a diffuse surface"),
        ("type = \"coated\"\nalpha = 0.1\nroughness_map = \"roughness.png\"\n", "beside `alpha`"),
        ("type = \"coated\"\nnormal_map = \"none.png\"\n", "none.png"),
        ("type = \"coated\"\nnormal_map = 1\n", "a string"),
        ("type = \"coated\"\nanisotropy_direction_map = \"normal.png\"\n", "but on a conductor"),
        ("type = \"coated\"\nnormal_map = \"normal.png\"\nemission = 1\n", "no such key"),
        ("normal_map = \"normal.png\"\n", "`type`"),
    ] {
        write(text);
        let error = load().unwrap_err();
        assert!(error.contains(message), "{error}");
    }

    // A file of one material has no maps for a scene; it says what to do.
    write(stretched);
    let error = Surface::load(&path, None).unwrap_err().to_string();
    assert!(error.contains("neubrdf train"), "{error}");
}

/// A stream of numbers in [0, 1).
struct Stream(u64);

impl Stream {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f64 / (1u64 << 24) as f64
    }

    /// A place and two directions down to 75°.
    fn query(&mut self) -> Query {
        let mut direction = || {
            let (z, phi) = (1.0 - 0.74 * self.unit(), std::f64::consts::TAU * self.unit());
            DVec3::new((1.0 - z * z).sqrt() * phi.cos(), (1.0 - z * z).sqrt() * phi.sin(), z)
        };
        let (wo, wi) = (direction(), direction());
        Query { footprint: Footprint::point(DVec2::new(self.unit(), self.unit())), wo, wi }
    }
}

fn learned(pairs: Vec<Pair>, is_isotropic: bool, side: u32) -> Evaluator {
    let plan = Plan { n_side: [8; 2], steps: 1500, ..small(Recipe::Default) }.over([side; 2]);
    let mut session = Session::new(plan, &GroundTruth::Samples { pairs: &pairs, is_isotropic }).unwrap();
    Evaluator::neubrdf(&NeuBrdf::decode(&finish(&mut session)).unwrap())
}

/// From a hundred samples a texel, what lies between and the averages over texels are learned.
#[test]
fn samples_of_a_material_that_varies_are_enough() {
    const SIDE: u32 = 4;
    let tiles = VaryingSurface::new(maps::tiles(SIDE, 0.0));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tiles.csv");
    let mut text = String::from("# tiles\nu,v,wi_theta,wi_phi,wo_theta,wo_phi,r,g,b\n");
    let mut random = Stream(1);
    for Query { footprint: place, wo, wi } in (0..1600).map(|_| random.query()) {
        let value = tiles.eval_at(place, wo, wi);
        let angles = |w: DVec3| [w.z.acos().to_degrees(), w.y.atan2(w.x).to_degrees()];
        let ([ti, pi], [to, po], DVec2 { x: u, y: v }) = (angles(wi), angles(wo), place.uv);
        // The difference of the azimuths alone counts.
        text += &format!("{u},{v},{ti},0,{to},{},{},{},{}\n", po - pi, value.x, value.y, value.z);
    }
    fs::write(&path, &text).unwrap();
    let samples = SurfaceSamples::load(&path).unwrap().unwrap();
    assert!(samples.is_isotropic && samples.samples.len() == 1600);
    let grid = SurfaceGrid::new(SIDE, SIDE).unwrap();
    let evaluator = learned(sample_pairs(&samples, grid, 1), true, SIDE);
    for (area, most) in [(0.0, 0.06), (1.0, 0.06)] {
        let errors = (0..500).map(|_| random.query()).map(|query| {
            let query = Query { footprint: Footprint { area, ..query.footprint }, ..query };
            let truth = tiles.eval_at(query.footprint, query.wo, query.wi);
            (evaluator.eval_at(&[query])[0].map(f64::ln_1p) - truth.map(f64::ln_1p)).abs().element_sum() / 3.0
        });
        let error = errors.sum::<f64>() / 500.0;
        eprintln!("area {area}: {error:.4}");
        assert!(error < most, "area {area}: mean |Δ ln(1 + f)| {error}");
    }
    // What reports compare with passes through the samples of a texel.
    let (uv, sample) = samples.samples[5];
    let found = TexelSamples::new(&samples, grid).eval_at(Footprint::point(uv.as_dvec2()), sample.wo, sample.wi);
    let most = 1e-3 * f64::from(sample.value.max_element().max(0.1));
    assert!((found - sample.value.as_dvec3()).abs().max_element() < most);

    let other = "wi_theta,wi_phi,wo_theta,wo_phi,r,g,b\n0,0,0,0,1,1,1\n";
    fs::write(&path, other).unwrap();
    assert!(SurfaceSamples::load(&path).unwrap().is_none());
    for (row, message) in [("1.5,0,0,0,0,0,1,1,1", "u: "), ("0,0,0,0,0,0,1,1", "8 columns"), ("", "no sample")] {
        fs::write(&path, format!("u,v,wi_theta,wi_phi,wo_theta,wo_phi,r,g,b\n{row}\n")).unwrap();
        let error = SurfaceSamples::load(&path).unwrap_err().to_string();
        assert!(error.contains(message), "{error}");
    }
}

/// A stack that is rendered from tiles, in the layout of published ones, says of each direction what the tiles are.
#[test]
fn a_stack_of_images_is_learned() {
    const SIDE: u32 = 8;
    let tiles = VaryingSurface::new(maps::tiles(SIDE, 0.0));
    let folder = tempfile::tempdir().unwrap();
    let polar = |theta: u32, phi: u32| {
        let (theta, phi) = (f64::from(theta).to_radians(), f64::from(phi).to_radians());
        DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
    };
    let rings: Vec<[u32; 2]> = [0, 15, 30, 45, 60]
        .into_iter()
        .flat_map(|theta| (0..if theta == 0 { 1 } else { 6 }).map(move |turn| [theta, 60 * turn]))
        .collect();
    let white = 0.1f32;
    for [tv, pv] in &rings {
        let views = folder.path().join(format!("tv{tv:03}_pv{pv:03}"));
        fs::create_dir(&views).unwrap();
        for (index, [tl, pl]) in rings.iter().enumerate() {
            let (wo, wi) = (polar(*tv, *pv), polar(*tl, *pl));
            let image = maps::texture(SIDE, |uv| {
                let f = tiles.eval_at(Footprint::point(uv.as_dvec2()), wo, wi).as_vec3();
                (f * (std::f32::consts::PI * wi.z as f32 * white)).min(Vec3::ONE)
            });
            save(&views.join(format!("{index:05} tl{tl:03} pl{pl:03} tv{tv:03} pv{pv:03}.png")), &image, srgb);
        }
    }
    fs::write(folder.path().join("btf.toml"), format!("white = {white}\n")).unwrap();
    let btf = Btf::open(folder.path()).unwrap();
    assert_eq!(btf.len(), rings.len() * rings.len());
    for index in (0..btf.len()).step_by(17) {
        let (image, [wo, wi]) = (btf.read(index).unwrap(), btf.directions(index));
        let uv = Vec2::new(3.5, 1.5) / SIDE as f32;
        let expected = tiles.eval_at(Footprint::point(uv.as_dvec2()), wo, wi);
        let found = image.sample(uv).as_dvec3();
        assert!((found - expected).abs().max_element() < 0.03 * expected.max_element() + 0.01, "{found} {expected}");
    }
    let grid = SurfaceGrid::new(SIDE, SIDE).unwrap();
    let (pairs, preview) = btf_pairs(&btf, grid, 1 << 16, 1).unwrap();
    let evaluator = learned(pairs, false, SIDE);
    let queries: Vec<Query> = (0..btf.len())
        .map(|index| {
            let ([wo, wi], step) = (btf.directions(index), index as f64);
            let uv = DVec2::new((0.7549 * step).fract(), (0.5698 * step).fract());
            Query { footprint: Footprint::point(uv), wo, wi }
        })
        .collect();
    let mean = |values: &mut dyn Iterator<Item = DVec3>| -> f64 {
        let differences = values.zip(&queries).map(|(value, query)| {
            let truth = tiles.eval_at(query.footprint, query.wo, query.wi);
            (value.map(f64::ln_1p) - truth.map(f64::ln_1p)).abs().element_sum() / 3.0
        });
        differences.sum::<f64>() / queries.len() as f64
    };
    let error = mean(&mut evaluator.eval_at(&queries).into_iter());
    assert!(error < 0.06, "mean |Δ ln(1 + f)| {error}");
    let error = mean(&mut queries.iter().map(|query| preview.eval_at(query.footprint, query.wo, query.wi)));
    assert!(error < 0.02, "of what the nearest image shows {error}");

    let error = || Btf::open(folder.path()).unwrap_err().to_string();
    fs::write(folder.path().join("btf.toml"), "encoding = \"rec709\"\n").unwrap();
    assert!(error().contains("\"srgb\" or \"linear\""), "{}", error());
    fs::remove_file(folder.path().join("btf.toml")).unwrap();
    fs::write(folder.path().join("tl090_pl000_tv000_pv000.png"), "").unwrap();
    assert!(error().contains("θ below 90"), "{}", error());
    assert!(Btf::open(tempfile::tempdir().unwrap().path()).unwrap_err().to_string().contains("no image"));
}
