//! What glTF's materials and meshes have beyond others: kernels agree with their twins on all of it, and the twins with what each
//! setting means.
use crate::kernels::{agreement, check, run, run_with_all_effects, small, twin_samples};
use crate::support::{assert_silent, gpu};
use glam::{Vec2, Vec3, vec2, vec3};
use tallow::image::{self, Film, Samples, WriteOptions};
use tallow::layout::{ATTRIBUTE_FLIPPED, Effects, MATERIAL_MASKED, TEXTURE_NEAREST};
use tallow::render::{Outputs, called_for};
use tallow::scene::description::*;
use tallow::scene::{Loaded, Scene};
use tallow::shaders::shared::segment::{BY_CHANCE, STRONGER_WAY};
use tallow::twins::surface::{
    Facing, Surface, facing_normals, facing_of_metal, shading_basis, surface_at, surface_bsdf,
};
use tallow::twins::texture::{mask_leaves, surface_opacity, texture_sample};
use tallow::twins::traverse::traverse;

/// A change, and its name.
type Plant = (&'static str, fn(&mut Loaded));

const SIDE: u32 = 8;

/// A wavy square of [-1, 1] in x and y with everything that a vertex may have.
pub fn patch() -> Mesh {
    let mut mesh = Mesh::default();
    for i in 0..=SIDE * SIDE + 2 * SIDE {
        let [u, v] = [i % (SIDE + 1), i / (SIDE + 1)].map(|k| k as f32 / SIDE as f32);
        let wave = (5.0 * u).sin();
        mesh.positions.push([2.0 * u - 1.0, 2.0 * v - 1.0, 0.1 * wave]);
        mesh.normals.push(vec3(-0.25 * (5.0 * u).cos(), 0.0, 1.0).normalize().to_array());
        mesh.uvs.push([u, v]);
        mesh.uvs2.push([1.0 - v, 0.3 * u]);
        mesh.colors.push([1.0 - 0.5 * u, 0.6 + 0.4 * v, 0.8, 0.4 + 0.6 * v]);
        mesh.tangents.push([0.8, 0.6, 0.0, -1.0]);
    }
    for i in (0..SIDE * (SIDE + 1)).filter(|i| i % (SIDE + 1) < SIDE) {
        mesh.indices.extend([0, 1, SIDE + 2, 0, SIDE + 2, SIDE + 1].map(|k| i + k));
    }
    mesh
}

fn bitmap(name: &str, texel: impl Fn(u32, u32) -> [u8; 4]) -> Bitmap {
    let rgba = (0..256).map(|i| texel(i % 16, i / 16)).collect::<Vec<_>>().into();
    Bitmap { name: name.into(), width: 16, height: 16, rgba }
}

pub fn texture(name: &str) -> Option<TextureTable> {
    Some(name.into())
}

fn materials() -> Vec<MaterialTable> {
    let metallic = |name: &str| MaterialTable {
        name: name.into(),
        kind: MaterialType::MetallicRoughness,
        roughness: Some(0.6),
        ..MaterialTable::default()
    };
    let checks = TextureTable {
        wrap: [Wrap::Mirror, Wrap::Clamp],
        filter: TextureFilter::Nearest,
        scale: [2.5, 1.5],
        rotate: 30.0,
        offset: [0.1, -0.2],
        .."checks".into()
    };
    let second = TextureTable { uv: 1, wrap: [Wrap::Clamp, Wrap::Mirror], ..TextureTable::from("bumps") };
    vec![
        MaterialTable {
            color_texture: Some(checks.clone()),
            metallic: Some(0.6),
            metallic_roughness_texture: texture("checks"),
            normal_map: Some(second),
            normal_scale: Some(0.7),
            specular: Some(Rgb([1.0, 0.5, 0.9])),
            specular_factor_texture: texture("checks"),
            ..metallic("enamel")
        },
        MaterialTable {
            metallic: Some(0.0),
            clearcoat: Some(0.9),
            clearcoat_roughness: Some(0.5),
            clearcoat_texture: texture("bumps"),
            clearcoat_roughness_texture: texture("checks"),
            clearcoat_normal_map: texture("bumps"),
            clearcoat_normal_scale: Some(1.5),
            ..metallic("lacquer")
        },
        MaterialTable {
            kind: MaterialType::Conductor,
            alpha: 0.5,
            alpha_v: Some(0.1),
            distribution: Distribution::Ggx,
            roughness: None,
            ..metallic("brushed")
        },
        MaterialTable {
            color_texture: Some(TextureTable { filter: TextureFilter::Nearest, ..TextureTable::from("checks") }),
            metallic: Some(0.0),
            alpha_mode: Some(AlphaMode::Mask),
            ..metallic("leaf")
        },
        MaterialTable {
            metallic: Some(0.0),
            color: Some(Rgb([0.9, 0.6, 0.3])),
            transmission_factor: Some(0.9),
            transmission_texture: texture("bumps"),
            ..metallic("pane")
        },
        MaterialTable { color_texture: Some(checks), unlit: true, ..metallic("sign") },
    ]
}

fn place(translate: [f64; 3], sign: f64) -> Transform {
    let [x, y, z] = translate;
    [sign, 0.0, 0.0, x, 0.0, 1.0, 0.0, y, 0.0, 0.0, 1.0, z, 0.0, 0.0, 0.0, 1.0].try_into().unwrap()
}

/// A patch of each material, one of them placed twice, once mirrored.
fn described() -> Description {
    let checks =
        |x: u32, y: u32| if (x / 4 + y / 4).is_multiple_of(2) { [230, 120, 40, 255] } else { [60, 150, 220, 90] };
    let bumps = |x: u32, y: u32| [100 + (x * 7 % 60) as u8, 100 + (y * 9 % 60) as u8, 235, 255];
    let at = |name: &str, x: f64, y: f64| MeshTable {
        name: Some(name.into()),
        material: Some(name.into()),
        data: Some(patch()),
        transform: place([x, y, 0.0], 1.0),
        ..MeshTable::default()
    };
    let instance = |x: f64, sign: f64| InstanceTable {
        mesh: "enamel".into(),
        transform: place([x, 1.1, 0.0], sign),
        ..InstanceTable::default()
    };
    Description {
        camera: Camera { position: Some([0.3, 1.0, 9.0]), target: Some([0.0, 1.0, 0.0]), ..Camera::default() },
        environment: Some(EnvironmentTable { radiance: Some(Rgb([0.7, 0.8, 1.0])), ..EnvironmentTable::default() }),
        material: materials(),
        mesh: vec![
            at("enamel", 0.0, 0.0),
            at("lacquer", 2.2, 1.1),
            at("leaf", -2.2, -1.1),
            at("pane", 0.0, -1.1),
            at("sign", 2.2, -1.1),
            at("brushed", 0.0, 3.2),
        ],
        instance: vec![instance(0.0, 1.0), instance(-2.2, -1.0)],
        light: vec![LightTable {
            kind: LightType::Point,
            position: Some([1.0, 3.0, 4.0]),
            intensity: Some(Rgb([40.0; 3])),
            ..LightTable::default()
        }],
        bitmap: vec![bitmap("checks", checks), bitmap("bumps", bumps)],
        ..Description::default()
    }
}

fn scene() -> Loaded {
    let mut scene = Scene::build(&described()).unwrap();
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    small(&mut scene.settings);
    scene
}

#[test]
fn materials_of_gltf_agree_with_their_twins() {
    let (gpu, scene) = (gpu(), scene());
    let effects = called_for(&scene, &scene.settings, Outputs::FILTERED);
    let Effects { texture_modes, second_uv, vertex_colors, tangents, alpha_cutoff, .. } = effects;
    assert_eq!([texture_modes, second_uv, vertex_colors, tangents, alpha_cutoff], [true; 5]);
    assert_eq!([effects.metallic, effects.clearcoat, effects.thin_walls], [true; 3]);
    assert_eq!([effects.coat_normals, effects.anisotropic], [true; 2]);
    let pair = run(&gpu, &scene, effects);
    check("materials", &pair);
    check("materials, all effects", &run_with_all_effects(&gpu, &scene));
    let by_four = run(&gpu, &scene, Effects { many_texels: true, ..effects });
    assert!(by_four.samples[0] == pair.samples[0], "words that are fetched by four are the same words");
    let whole = agreement(&pair.samples);
    // Controls: the twin's samples of scenes in which one thing is another.
    let plants: [Plant; 7] = [
        ("interpolation", |s| s.textures.iter_mut().for_each(|t| t.flags &= !TEXTURE_NEAREST)),
        ("turn", |s| s.textures.iter_mut().for_each(|t| t.shear = [0.0; 2])),
        ("bitangents", |s| s.shading.iter_mut().for_each(|r| r.attributes ^= ATTRIBUTE_FLIPPED)),
        ("cutoff", |s| s.materials.iter_mut().for_each(|m| m.alpha_cutoff = 0.0)),
        ("coat normals", |s| s.materials.iter_mut().for_each(|m| m.clearcoat_normal_scale = 0.0)),
        ("brushing", |s| s.materials.iter_mut().for_each(|m| m.anisotropy = 0.0)),
        ("normal scale", |s| s.materials.iter_mut().for_each(|m| m.normal_scale = 1.0)),
    ];
    for (name, plant) in plants {
        let mut other = scene.clone();
        plant(&mut other);
        let share = agreement(&[pair.samples[0].clone(), twin_samples(&other, effects).0]);
        assert!(share < whole - 0.004, "control: {name}: {share} of {whole}");
    }
    assert_silent(&gpu);
}

/// The surface that a ray along -z at (x, y) meets, of a scene without perspective.
pub fn surface(scene: &Scene, x: f32, y: f32) -> Surface {
    let hit = traverse(scene, vec3(x, y, 5.0), Vec3::NEG_Z, 100.0, false, 0);
    assert!(hit.any(), "nothing at {x}, {y}");
    surface_at(scene, &hit)
}

/// One patch of one material in world space.
pub fn one(material: MaterialTable, mesh: Mesh, transform: Transform, flip_normals: bool) -> Scene {
    let whole = described();
    let name = material.name.clone();
    let table = MeshTable { material: Some(name), data: Some(mesh), transform, flip_normals, ..MeshTable::default() };
    Scene::build(&Description { material: vec![material], mesh: vec![table], instance: Vec::new(), ..whole })
        .unwrap()
        .scene
}

#[test]
fn given_tangents_are_those_of_the_coordinates_in_every_placement() {
    let mapped = || MaterialTable {
        name: "m".into(),
        kind: MaterialType::MetallicRoughness,
        normal_map: texture("bumps"),
        ..MaterialTable::default()
    };
    let flat = || {
        let mut mesh = patch();
        mesh.positions.iter_mut().for_each(|p| p[2] = 0.0);
        mesh.normals.iter_mut().for_each(|n| *n = [0.0, 0.0, 1.0]);
        mesh
    };
    let given = || {
        let mut mesh = flat();
        mesh.tangents.iter_mut().for_each(|t| *t = [2.0, 0.0, 0.0, 1.0]);
        mesh
    };
    let derived = || Mesh { tangents: Vec::new(), ..flat() };
    for (transform, flip) in
        [(1.0, false), (-1.0, false), (1.0, true), (-1.0, true)].map(|(s, f)| (place([0.0; 3], s), f))
    {
        let [a, b] = [given(), derived()].map(|mesh| one(mapped(), mesh, transform, flip));
        let [with, without] = [&a, &b].map(|s| surface(s, 0.3, -0.4));
        assert!(with.tangent.w != 0.0 && without.tangent.w == 0.0);
        assert!((with.normal - without.normal).length() < 1e-4, "{transform:?} {flip}: {with:?} {without:?}");
        assert!((with.normal - with.smooth_normal).length() > 0.01, "control: a map that does nothing");
    }
}

#[test]
fn vertex_colours_multiply_the_base_colour() {
    let plain = |name: &str, kind| MaterialTable {
        name: name.into(),
        kind,
        color: Some(Rgb([0.5; 3])),
        metallic: Some(0.0),
        ..MaterialTable::default()
    };
    for kind in [MaterialType::Diffuse, MaterialType::MetallicRoughness] {
        let scene = one(plain("m", kind), patch(), place([0.0; 3], 1.0), false);
        let s = surface(&scene, 0.5, -0.25); // u = 0.75, v = 0.375
        let found = surface_bsdf(&scene, &s);
        let color = if kind == MaterialType::Diffuse { found.albedo } else { found.metallic.diffuse };
        let expected = 0.5 * vec3(0.625, 0.75, 0.8);
        assert!((color - expected).length() < 1e-3, "{color} {expected}");
    }
}

#[test]
fn wrap_modes_and_filters_are_what_they_say() {
    // Reads the red channel, which tells the texel: 16 columns, of value 10 * column; v = 0.5 + is row 7.
    let ramp = |t: TextureTable| {
        let material = MaterialTable {
            name: "m".into(),
            kind: MaterialType::MetallicRoughness,
            metallic_roughness_texture: Some(TextureTable { file: "ramp".into(), ..t }),
            ..MaterialTable::default()
        };
        let mesh = MeshTable { material: Some("m".into()), data: Some(patch()), ..MeshTable::default() };
        let picture = bitmap("ramp", |x, y| [10 * x as u8, 10 * y as u8, 0, 0]);
        Scene::build(&Description {
            material: vec![material],
            mesh: vec![mesh],
            bitmap: vec![picture],
            ..Default::default()
        })
        .unwrap()
        .scene
    };
    let read = |scene: &Scene, u: f32, v: f32| -> Vec2 {
        let c = texture_sample(scene, scene.materials[0].roughness_texture, vec2(u, v));
        vec2(c.x, c.y) * 25.5
    };
    let close = |found: Vec2, x: f32, y: f32| assert!((found - vec2(x, y)).length() < 1e-3, "{found} ({x}, {y})");
    let nearest = |wrap| TextureTable { filter: TextureFilter::Nearest, wrap, ..TextureTable::default() };
    let s = ramp(nearest([Wrap::Repeat; 2]));
    // The upper left texel is (0, 0), and v points up.
    close(read(&s, 0.01, 0.99), 0.0, 0.0);
    close(read(&s, 0.26, 0.99), 4.0, 0.0);
    close(read(&s, 1.26, 0.01), 4.0, 15.0);
    let s = ramp(nearest([Wrap::Mirror, Wrap::Clamp]));
    close(read(&s, 1.26, 0.99), 11.0, 0.0);
    close(read(&s, -0.26, 1.7), 4.0, 0.0);
    close(read(&s, 2.26, -0.7), 4.0, 15.0);
    let s = ramp(nearest([Wrap::Clamp, Wrap::Repeat]));
    close(read(&s, 1.26, -0.01), 15.0, 0.0);
    close(read(&s, -3.0, 0.01), 0.0, 15.0);
    // Between two texels; a mirrored border goes on with itself.
    let s = ramp(TextureTable { wrap: [Wrap::Mirror, Wrap::Repeat], ..TextureTable::default() });
    close(read(&s, 2.0 / 16.0, 0.5), 1.5, 7.5);
    close(read(&s, 1.0, 0.5), 15.0, 7.5);
    // A quarter counter-clockwise of coordinates whose v points down: (u, w) reads (w, -u).
    let s = ramp(TextureTable { rotate: 90.0, ..nearest([Wrap::Repeat; 2]) });
    let w = 0.3; // v = 0.7
    close(read(&s, 0.1, 1.0 - w), (16.0f32 * w).floor(), (16.0f32 * 0.9).floor());
}

#[test]
fn a_cutoff_masks_all_or_nothing() {
    let leaf = |mode, cutoff| MaterialTable {
        name: "m".into(),
        kind: MaterialType::MetallicRoughness,
        alpha_mode: Some(mode),
        alpha_cutoff: cutoff,
        ..MaterialTable::default()
    };
    // Alpha is 0.4 + 0.6 v by the vertices alone.
    let opacities = |material| {
        let scene = one(material, patch(), place([0.0; 3], 1.0), false);
        let at = |y: f32| {
            let hit = traverse(&scene, vec3(0.0, y, 5.0), Vec3::NEG_Z, 100.0, false, 0);
            let masked = scene.materials[0].flags & MATERIAL_MASKED != 0;
            let opacity = |t| surface_opacity(&scene, 0, t, hit.barycentric);
            if hit.any() { if masked { opacity(hit.triangle) } else { 1.0 } } else { 0.0 }
        };
        [at(-0.9), at(0.9)]
    };
    assert_eq!(opacities(leaf(AlphaMode::Mask, None)), [0.0, 1.0]);
    assert_eq!(opacities(leaf(AlphaMode::Mask, Some(0.0))), [1.0, 1.0]);
    assert_eq!(opacities(leaf(AlphaMode::Opaque, None)), [1.0, 1.0]);
    let scene = one(leaf(AlphaMode::Blend, None), patch(), place([0.0; 3], 1.0), false);
    let passes = |seed: u32| mask_leaves(&scene, 0, u32::MAX, vec2(0.1, 0.1), Vec3::Z, seed) == Vec3::ONE;
    let passed = (0..256u32).filter(|index| passes(index.reverse_bits() | BY_CHANCE)).count();
    let opacity = surface_opacity(&scene, 0, 0, vec2(0.1, 0.1));
    assert!((passed as f32 - 256.0 * (1.0 - opacity)).abs() <= 1.0, "{passed} of 256 pass {opacity}");
    assert_eq!(passes(STRONGER_WAY), opacity <= 0.5);
}

#[test]
fn a_slope_of_metal_mirrors_nothing_into_the_surface() {
    let gold = MaterialTable {
        name: "m".into(),
        kind: MaterialType::MetallicRoughness,
        normal_map: texture("bumps"),
        normal_scale: Some(6.0),
        ..MaterialTable::default()
    };
    let scene = one(gold, patch(), place([0.0; 3], 1.0), false);
    let mut below = 0;
    for i in 0..400 {
        let s = surface(&scene, -0.9 + 0.09 * (i % 20) as f32, -0.9 + 0.09 * (i / 20) as f32);
        let wo = vec3(0.6, 0.2, 0.5).normalize();
        let facing = facing_normals(&s, wo, true, true);
        let height = |f: &Facing| (2.0 * f.normal.dot(wo) * f.normal - wo).dot(s.geometric);
        below += usize::from(height(&facing) < -0.01);
        let metal = facing_of_metal(&s, facing, wo, 1.0);
        assert!(height(&metal) > -1e-4 && (metal.normal.length() - 1.0).abs() < 1e-4, "{facing:?} {metal:?}");
        assert_eq!(facing_of_metal(&s, facing, wo, 0.1).normal, facing.normal, "a dielectric keeps its slopes");
    }
    assert!(below > 20, "control: only {below} slopes are steep");
}

#[test]
fn an_orthographic_camera_agrees_with_its_twin() {
    let gpu = gpu();
    let view = |orthographic| {
        let camera = Camera { orthographic, ..described().camera };
        let mut scene = Scene::build(&Description { camera, ..described() }).unwrap();
        small(&mut scene.settings);
        scene
    };
    let scene = view(Some(4.4));
    let outputs = Outputs::FILTERED;
    let effects = called_for(&scene, &scene.settings, outputs);
    assert!(effects.orthographic && !called_for(&view(None), &scene.settings, outputs).orthographic);
    let pair = run(&gpu, &scene, effects);
    check("orthographic", &pair);
    check("orthographic, all effects", &run_with_all_effects(&gpu, &scene));
    // Control: in perspective the picture is another.
    let others = run(&gpu, &view(None), Effects { orthographic: false, ..effects }).samples;
    assert!(agreement(&[others[0].clone(), pair.samples[1].clone()]) < agreement(&pair.samples) - 0.1, "control");
    assert_silent(&gpu);
}

/// A picture of floats up to 3, with an alpha channel.
fn floats(folder: &std::path::Path) -> TextureTable {
    let mut film = Film::new(8, 8);
    let ramp = |scale: f32, shift: usize| (0..64).map(|i| scale * ((i * 5 + shift) % 64) as f32 / 63.0).collect();
    for (name, scale, shift) in [("R", 3.0, 0), ("G", 1.0, 17), ("B", 0.4, 40), ("A", 1.0, 9)] {
        film.add(name, Samples::F32(ramp(scale, shift)));
    }
    let path = folder.join("floats.exr");
    image::write(&path, &film, &WriteOptions::default()).unwrap();
    path.as_path().into()
}

#[test]
fn pictures_of_floats_agree_with_their_twins() {
    let (gpu, folder) = (gpu(), tempfile::tempdir().unwrap());
    let picture = || Some(floats(folder.path()));
    let mut description = described();
    for table in &mut description.material {
        match table.name.as_str() {
            "enamel" => (table.color_texture, table.metallic_roughness_texture) = (picture(), picture()),
            "lacquer" => (table.emission_texture, table.clearcoat_roughness_texture) = (picture(), picture()),
            "leaf" => table.color_texture = picture(),
            _ => {}
        }
    }
    let mut scene = Scene::build(&description).unwrap();
    let as_told = |told: &String| told.contains("numbers of 42 texels lie outside [0, 1]");
    assert!(scene.warnings.len() == 1 && scene.warnings.iter().all(as_told), "{:?}", scene.warnings);
    small(&mut scene.settings);
    let effects = called_for(&scene, &scene.settings, Outputs::FILTERED);
    assert!(effects.hdr_textures);
    let pair = run(&gpu, &scene, effects);
    check("floats", &pair);
    let others = run(&gpu, &scene, Effects { hdr_textures: false, ..effects }).samples;
    assert!(agreement(&[others[0].clone(), pair.samples[1].clone()]) < agreement(&pair.samples) - 0.05, "control");
    assert_silent(&gpu);
}

#[test]
fn metal_is_smoother_along_v_where_its_coordinates_say_so() {
    let brushed = |alpha_v| MaterialTable {
        name: "m".into(),
        kind: MaterialType::Conductor,
        alpha: 0.4,
        alpha_v,
        ..MaterialTable::default()
    };
    let flat = |turned: bool| {
        let mut mesh = patch();
        mesh.positions.iter_mut().for_each(|p| p[2] = 0.0);
        mesh.normals.iter_mut().for_each(|n| *n = [0.0, 0.0, 1.0]);
        mesh.tangents.clear();
        if turned {
            mesh.uvs.iter_mut().for_each(|uv| *uv = [uv[1], uv[0]]);
        }
        mesh
    };
    let frame = |material, mesh, transform| {
        let scene = one(material, mesh, transform, false);
        let s = surface(&scene, 0.3, -0.4);
        let b = surface_bsdf(&scene, &s);
        (shading_basis(&s, &b, s.normal), b.alpha, b.stretch)
    };
    for (turned, expected) in [(false, Vec3::X), (true, Vec3::Y)] {
        let (basis, alpha, stretch) = frame(brushed(Some(0.1)), flat(turned), place([0.0; 3], 1.0));
        assert!(basis.x_axis.dot(expected).abs() > 0.999, "{basis}");
        assert!(alpha == 0.4 && (stretch - 0.25).abs() < 1e-6);
        assert!((basis.determinant() - 1.0).abs() < 1e-5 && basis.z_axis.z > 0.999);
    }
    // Given tangents take the place of coordinates.
    let mut mesh = flat(false);
    mesh.tangents = vec![[0.6, 0.8, 0.0, 1.0]; mesh.positions.len()];
    let (basis, ..) = frame(brushed(Some(0.1)), mesh, place([0.0; 3], 1.0));
    assert!(basis.x_axis.dot(vec3(0.6, 0.8, 0.0)).abs() > 0.999, "{basis}");
    assert_eq!(frame(brushed(None), flat(false), place([0.0; 3], 1.0)).2, 1.0);
}

/// What makes a brushed metal smoother, a picture or a key, leaves it rough along both directions or none: .01 is the least.
#[test]
fn metal_is_not_smooth_along_one_direction_alone() {
    let gpu = gpu();
    let brushed = |alpha, alpha_v| MaterialTable {
        name: "m".into(),
        kind: MaterialType::Conductor,
        alpha,
        alpha_v: Some(alpha_v),
        roughness_texture: texture("bumps"),
        ..MaterialTable::default()
    };
    let roughness = |scene: &Scene| {
        let b = surface_bsdf(scene, &surface(scene, 0.3, -0.4));
        [b.alpha, b.alpha * b.stretch]
    };
    let plain = roughness(&one(brushed(0.4, 0.2), patch(), place([0.0; 3], 1.0), false));
    let share = plain[0] / 0.4;
    assert!((0.2..0.6).contains(&share) && (plain[1] / 0.2 - share).abs() < 1e-6, "control: {plain:?}");
    for (of, expected) in [
        ([0.01, 0.3], [0.01, 0.3 * share]),
        ([0.3, 0.01], [0.3 * share, 0.01]),
        ([0.012, 0.015], [0.012 * share, 0.015 * share]),
    ] {
        let mut loaded =
            Loaded { scene: one(brushed(of[0], of[1]), patch(), place([0.0; 3], 1.0), false), ..Loaded::default() };
        let found = roughness(&loaded.scene);
        assert!((0..2).all(|k| (found[k] / expected[k] - 1.0).abs() < 1e-5), "{of:?}: {found:?}, not {expected:?}");
        small(&mut loaded.settings);
        let effects = called_for(&loaded, &loaded.settings, Outputs::FILTERED);
        check(&format!("brushed, {of:?}"), &run(&gpu, &loaded, effects));
    }
    assert_silent(&gpu);
}

#[test]
fn a_clear_coat_has_normals_of_its_own() {
    let coated = |own: bool, base: bool| MaterialTable {
        name: "m".into(),
        kind: MaterialType::MetallicRoughness,
        clearcoat: Some(1.0),
        clearcoat_normal_map: if own { texture("bumps") } else { None },
        normal_map: if base { texture("bumps") } else { None },
        ..MaterialTable::default()
    };
    let at = |own, base| surface(&one(coated(own, base), patch(), place([0.0; 3], 1.0), false), 0.3, -0.4);
    let [both, coat, below, none] = [(true, true), (true, false), (false, true), (false, false)].map(|(o, b)| at(o, b));
    assert!((both.normal - both.coat_normal).length() < 1e-6 && both.normal != both.smooth_normal);
    assert!(coat.normal == coat.smooth_normal && coat.coat_normal == both.coat_normal);
    assert!(
        below.normal == both.normal && below.coat_normal == below.smooth_normal,
        "the base's map is not the coat's"
    );
    assert!(none.normal == none.smooth_normal && none.coat_normal == none.smooth_normal);
}
