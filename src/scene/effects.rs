//! Finds the effects that a scene and its settings need, and what needs each. Kernels are compiled without the others.
use super::Scene;
use super::build::{geometry, lights};
use super::load::material::has_normal_map;
use crate::layout::*;
use crate::scene::description::settings::{PixelFilter, Sampler, Settings, Split};
use crate::settings::entry::Value;

/// The effects of a scene with its settings, and for each one that is on the first object, material, light or setting that needs
/// it. `split_light` asks for direct and indirect light in separate layers, `counters` for counts of rays.
pub fn effects(
    scene: &Scene,
    settings: &Settings,
    split_light: bool,
    counters: bool,
) -> (Effects, Vec<(Effect, String)>) {
    let mut reasons = Vec::new();
    let used = used_materials(scene);
    let mut material = |name, calls: &dyn Fn(&Material) -> bool| {
        let first = (0..scene.materials.len()).find(|&i| used[i] && calls(&scene.materials[i]));
        let named = |i: usize| scene.names.materials.get(i).map_or("", |n| n);
        first.inspect(|&i| reasons.push((name, format!("material \"{}\"", named(i))))).is_some()
    };
    let interface = |m: &Material| m.kind != BSDF_DIFFUSE;
    let mapped = |m: &Material, effect| m.textures().any(|(reader, _)| reader == effect);
    let flagged = |m: &Material, flags: u32| {
        m.textures().filter_map(|(_, t)| scene.textures.get(t as usize)).any(|t| t.flags & flags != 0)
    };
    let coated = |m: &Material| m.kind == BSDF_METALLIC && m.clearcoat > 0.0;
    // A roughness map may take any part of the surface below the line.
    let smooth = |m: &Material| {
        let coat = coated(m) && (m.clearcoat_alpha < SMOOTH_ALPHA || m.clearcoat_roughness_texture != NONE);
        interface(m) && (m.alpha < SMOOTH_ALPHA || m.roughness_texture != NONE) || coat
    };
    let rough = |m: &Material| {
        let coat = coated(m) && m.clearcoat_alpha >= SMOOTH_ALPHA;
        interface(m) && m.alpha >= SMOOTH_ALPHA || coat
    };
    // Shadow rays pass them as they pass masks.
    let sharp = scene.has_delta_lights();
    let clear_wall = |m: &Material| sharp && m.flags & MATERIAL_CLEAR_WALL != 0;
    let mut found = Effects {
        textures: material(Effect::textures, &|m| mapped(m, Effect::textures)),
        texture_modes: material(Effect::texture_modes, &|m| flagged(m, MODES)),
        hdr_textures: material(Effect::hdr_textures, &|m| flagged(m, TEXTURE_RGB9E5 | TEXTURE_FLOAT)),
        second_uv: material(Effect::second_uv, &|m| flagged(m, TEXTURE_SECOND_UV)),
        alpha_cutoff: material(Effect::alpha_cutoff, &|m| m.flags & MATERIAL_MASKED != 0 && m.alpha_cutoff > 0.0),
        bump_maps: material(Effect::bump_maps, &|m| mapped(m, Effect::bump_maps)),
        normal_maps: material(Effect::normal_maps, &|m| mapped(m, Effect::normal_maps)),
        alpha_masks: material(Effect::alpha_masks, &|m| m.flags & MATERIAL_MASKED != 0 || clear_wall(m)),
        diffuse: material(Effect::diffuse, &|m| matches!(m.kind, BSDF_DIFFUSE | BSDF_COATED)),
        conductor: material(Effect::conductor, &|m| m.kind == BSDF_CONDUCTOR),
        dielectric: material(Effect::dielectric, &|m| m.kind == BSDF_DIELECTRIC),
        coated: material(Effect::coated, &|m| m.kind == BSDF_COATED),
        metallic: material(Effect::metallic, &|m| m.kind == BSDF_METALLIC),
        clearcoat: material(Effect::clearcoat, &coated),
        coat_normals: material(Effect::coat_normals, &|m| coated(m) && has_normal_map(m)),
        thin_walls: material(Effect::thin_walls, &|m| m.kind == BSDF_METALLIC && m.transmission_factor > 0.0),
        clear_walls: material(Effect::clear_walls, &clear_wall),
        two_sided_lamps: material(Effect::two_sided_lamps, &|m| m.flags & MATERIAL_EMITS_BEHIND != 0),
        anisotropic: material(Effect::anisotropic, &|m| m.anisotropy != 0.0),
        rough: material(Effect::rough, &rough),
        smooth_interface: material(Effect::smooth_interface, &smooth),
        beckmann: material(Effect::beckmann, &|m| rough(m) && m.flags & MATERIAL_GGX == 0),
        ggx: material(Effect::ggx, &|m| rough(m) && m.flags & MATERIAL_GGX != 0),
        ..Effects::default()
    };
    light_effects(scene, &mut found, &mut reasons);
    camera_effects(scene, &mut found, &mut reasons);
    scene_effects(scene, &mut found, &mut reasons);
    setting_effects(settings, &mut found, &mut reasons);
    let soft = keeps_soft_light_apart(scene, settings);
    found.soft_light = because(&mut reasons, Effect::soft_light, soft, format!("split {}", settings.split.text()));
    output_effects(split_light, counters, &mut found, &mut reasons);
    reasons.sort_by_key(|r| r.0);
    (found, reasons)
}

/// What only some textures do.
const MODES: u32 =
    TEXTURE_CLAMP_U | TEXTURE_CLAMP_V | TEXTURE_MIRROR_U | TEXTURE_MIRROR_V | TEXTURE_NEAREST | TEXTURE_SHEARED;

/// Materials that some triangle or instance has.
fn used_materials(scene: &Scene) -> Vec<bool> {
    let mut used = vec![false; scene.materials.len()];
    let triangles = scene.triangles.iter().map(|t| t.material);
    let worn = triangles.chain(scene.instances.iter().map(|i| i.material).filter(|&m| m != NONE));
    for material in worn {
        if let Some(slot) = used.get_mut(material as usize) {
            *slot = true;
        }
    }
    used
}

/// Those of the effects that lights and the camera call for.
pub fn light_and_camera_effects(scene: &Scene) -> Effects {
    let mut found = Effects::default();
    light_effects(scene, &mut found, &mut Vec::new());
    camera_effects(scene, &mut found, &mut Vec::new());
    found
}

fn light_effects(scene: &Scene, found: &mut Effects, reasons: &mut Reasons) {
    // Those that are dark now are in the rig, and a pose may switch them on.
    let mut light = |effect| {
        let first = scene.lights.iter().chain(&scene.rig.lights).position(|l| l.effect() == Some(effect));
        first.inspect(|&i| reasons.push((effect, light_name(scene, i)))).is_some()
    };
    found.emissive = light(Effect::emissive);
    found.point_lights = light(Effect::point_lights);
    found.spot_lights = light(Effect::spot_lights);
    found.directional_lights = light(Effect::directional_lights);
    found.environment = light(Effect::environment);
    let mapped = found.environment && scene.environment.is_some();
    found.environment_map = because(reasons, Effect::environment_map, mapped, "environment".into());
    let panels = scene.lights.iter().any(Light::is_triangle);
    let large = scene.lights.iter().position(|l| lights::is_large(scene, l));
    let name = large.map_or_else(|| "lamps that were or may come to be large".to_owned(), |i| light_name(scene, i));
    let weighed = scene.weighed_lights;
    found.weighed_lights = because(reasons, Effect::weighed_lights, weighed, "several point or spot lights".into());
    found.light_tree = because(reasons, Effect::light_tree, scene.has_light_tree(), "several lamps".into());
    found.large_lamps = because(reasons, Effect::large_lamps, panels && scene.large_lamps, name);
}

/// That of a light of the scene or, with a number beyond those, of the rig.
fn light_name(scene: &Scene, index: usize) -> String {
    let Some(light) = scene.lights.get(index) else {
        return match index - scene.lights.len() {
            sky if scene.rig.lights[sky].kind == LIGHT_ENVIRONMENT => "environment, which is dark".into(),
            number => format!("[[light]] {number}, which is dark"),
        };
    };
    match scene.names.materials.get(light.material as usize) {
        Some(name) => format!("material \"{name}\""),
        None if light.kind == LIGHT_ENVIRONMENT => "environment".into(),
        None => format!("light {index}"),
    }
}

type Reasons = Vec<(Effect, String)>;

/// Notes why an effect is on.
fn because(reasons: &mut Reasons, name: Effect, on: bool, why: String) -> bool {
    if on {
        reasons.push((name, why));
    }
    on
}

/// Triangles from which on rays gain from testing each other's. In a Cornell box of 36 most lanes have some to test at every
/// node, so that dealing them costs a sixth; scenes of 1,650 gain a little, of 100,000 a third.
const DEALT_FROM: usize = 1000;
/// Most texels of textures that are read one at a time: views of more are beyond the limit of lavapipe and of NVIDIA's driver.
const NARROW_TEXELS: usize = 1 << 27;

fn camera_effects(scene: &Scene, found: &mut Effects, reasons: &mut Reasons) {
    let mut because = |name, on, why: &str| because(reasons, name, on, why.to_owned());
    found.lens = because(Effect::lens, scene.view.lens_radius > 0.0, "camera lens_radius");
    found.orthographic = because(Effect::orthographic, scene.view.orthographic.is_some(), "camera orthographic");
}

fn scene_effects(scene: &Scene, found: &mut Effects, reasons: &mut Reasons) {
    let mut because = |name, on, why| because(reasons, name, on, why);
    let bent = scene.shading.iter().position(|s| s.normal != geometry::FLAT);
    let object =
        bent.and_then(|i| scene.triangles.get(i)).map(|t| t.object as usize).and_then(|o| scene.names.objects.get(o));
    let named = format!("object \"{}\"", object.map_or("", |o| o));
    found.smooth_normals = because(Effect::smooth_normals, bent.is_some(), named);
    let mut attribute = |name, bit: u32| {
        let first = scene.shading.iter().position(|s| s.attributes & bit != 0).and_then(|i| scene.triangles.get(i));
        let object = first.and_then(|t| scene.names.objects.get(t.object as usize));
        because(name, first.is_some(), format!("object \"{}\"", object.map_or("", |o| o)))
    };
    found.vertex_colors = attribute(Effect::vertex_colors, ATTRIBUTE_COLORS);
    let directed = found.normal_maps || found.coat_normals || found.anisotropic;
    found.tangents = directed && attribute(Effect::tangents, ATTRIBUTE_TANGENTS);
    let ball = scene.triangles.iter().find(|t| t.primitive & SPHERE != 0);
    let object = ball.and_then(|t| scene.names.objects.get(t.object as usize));
    found.spheres = because(Effect::spheres, ball.is_some(), format!("object \"{}\"", object.map_or("", |o| o)));
    let instances = scene.instances.len();
    found.instances = because(Effect::instances, instances > 0, format!("{instances} instances"));
    let triangles = scene.triangles.len();
    let dealt = triangles >= DEALT_FROM;
    found.dealt_triangles = because(Effect::dealt_triangles, dealt, format!("{triangles} triangles"));
    let texels = scene.texels.len();
    found.many_texels = because(Effect::many_texels, texels > NARROW_TEXELS, format!("{texels} texels of textures"));
}

fn setting_effects(s: &Settings, found: &mut Effects, reasons: &mut Reasons) {
    let mut because = |name, on, why| because(reasons, name, on, why);
    found.indirect = because(Effect::indirect, s.max_depth > 2, format!("max_depth {}", s.max_depth));
    found.roulette = because(Effect::roulette, s.roulette_depth > 0, format!("roulette_depth {}", s.roulette_depth));
    found.clamp = because(Effect::clamp, s.clamp_indirect > 0.0, format!("clamp_indirect {}", s.clamp_indirect));
    let stride = s.indirect_stride;
    found.sparse_light = because(Effect::sparse_light, stride > 1, format!("indirect_stride {stride}"));
    found.pixel_filter = because(Effect::pixel_filter, s.filter != PixelFilter::Box, format!("filter {:?}", s.filter));
    let independent = s.sampler == Sampler::Independent;
    found.independent_sampler = because(Effect::independent_sampler, independent, "sampler independent".into());
    let policy = s.allocate.policy.name;
    found.adaptive = because(Effect::adaptive, !s.allocate.is_even(), format!("allocate {policy}"));
    let most = s.spp.max(s.allocate.max_spp);
    found.many_samples = because(Effect::many_samples, most > 4096, format!("{most} samples of a pixel"));
}

/// Whether what lamps and sky bring to the first hit is kept with indirect light. Shadows of delta lights are sharp and free of
/// noise, those of lamps and sky are neither.
pub fn keeps_soft_light_apart(scene: &Scene, settings: &Settings) -> bool {
    settings.split == Split::Soft && scene.has_soft_lights()
}

fn output_effects(split_light: bool, counters: bool, found: &mut Effects, reasons: &mut Reasons) {
    let why = "an output that keeps direct and indirect light apart";
    found.split_light = because(reasons, Effect::split_light, split_light, why.into());
    found.counters = because(reasons, Effect::counters, counters, "ray counters".into());
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::load::material::Materials;

    #[test]
    fn only_what_is_worn_calls() {
        let mut scene = Scene::default();
        let mut mirror = Materials::plain([0.0; 3]);
        mirror.kind = BSDF_CONDUCTOR;
        scene.materials = vec![Materials::plain([0.5; 3]), mirror];
        scene.names.materials = vec!["wall".into(), "mirror".into()];
        scene.names.objects = vec!["box".into()];
        scene.triangles = vec![Triangle::default()];
        let settings = Settings { max_depth: 2, ..Settings::default() };
        let (found, reasons) = effects(&scene, &settings, false, false);
        assert_eq!(found, Effects { diffuse: true, ..Effects::default() });
        assert_eq!(reasons, [(Effect::diffuse, "material \"wall\"".to_owned())]);
        scene.triangles[0].material = 1;
        let (found, reasons) = effects(&scene, &settings, true, false);
        let expected = Effects { conductor: true, smooth_interface: true, split_light: true, ..Effects::default() };
        assert_eq!(found, expected);
        assert_eq!(reasons[0], (Effect::conductor, "material \"mirror\"".to_owned()));
        assert_eq!(reasons.len(), 3);
    }
}
