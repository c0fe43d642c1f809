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
    let mut found = Found::default();
    found.by_materials(scene);
    found.by_lights(scene);
    found.by_camera(scene);
    found.by_geometry(scene);
    found.by_settings(settings);
    let soft = keeps_soft_light_apart(scene, settings);
    found.need(Effect::soft_light, soft.then(|| format!("split {}", settings.split.text())));
    let apart = "an output that keeps direct and indirect light apart";
    found.need(Effect::split_light, split_light.then(|| apart.into()));
    found.need(Effect::counters, counters.then(|| "ray counters".into()));
    found.reasons.sort_by_key(|r| r.0);
    (found.effects, found.reasons)
}

/// Those of the effects that lights and the camera call for.
pub fn light_and_camera_effects(scene: &Scene) -> Effects {
    let mut found = Found::default();
    found.by_lights(scene);
    found.by_camera(scene);
    found.effects
}

/// Whether what all but the key light brings to the first hit is kept with indirect light. Shadows of that light are sharp and free of
/// noise, those of lamps and sky are neither.
pub fn keeps_soft_light_apart(scene: &Scene, settings: &Settings) -> bool {
    settings.split == Split::Soft && scene.has_soft_lights()
}

/// What only some textures do.
const MODES: u32 =
    TEXTURE_CLAMP_U | TEXTURE_CLAMP_V | TEXTURE_MIRROR_U | TEXTURE_MIRROR_V | TEXTURE_NEAREST | TEXTURE_SHEARED;
/// Triangles from which on rays gain from testing each other's. In a Cornell box of 36 most lanes have some to test at every
/// node, so that dealing them costs a sixth; scenes of 1,650 gain a little, of 100,000 a third.
const DEALT_FROM: usize = 1000;
/// Most texels of textures that are read one at a time: views of more are beyond the limit of lavapipe and of NVIDIA's driver.
const NARROW_TEXELS: usize = 1 << 27;

/// The effects that are on so far, and what needs each.
#[derive(Default)]
struct Found {
    effects: Effects,
    reasons: Vec<(Effect, String)>,
}

impl Found {
    /// Switches an effect on if something needs it.
    fn need(&mut self, effect: Effect, by: Option<String>) {
        if let Some(by) = by {
            *self.effects.switch(effect) = true;
            self.reasons.push((effect, by));
        }
    }

    fn by_materials(&mut self, scene: &Scene) {
        let (used, sharp) = (used_materials(scene), scene.has_delta_lights());
        for &effect in Effect::ALL {
            let mut all = scene.materials.iter().zip(&used);
            let first = all.position(|(m, used)| *used && material_needs(scene, m, sharp, effect));
            let name = |i: usize| scene.names.materials.get(i).map_or("", |n| n);
            self.need(effect, first.map(|i| format!("material \"{}\"", name(i))));
        }
    }

    fn by_lights(&mut self, scene: &Scene) {
        use Effect::{directional_lights, emissive, environment, point_lights, spot_lights};
        for effect in [emissive, point_lights, spot_lights, directional_lights, environment] {
            // Those that are dark now are in the rig, and a pose may switch them on.
            let first = scene.lights.iter().chain(&scene.rig.lights).position(|l| l.effect() == Some(effect));
            self.need(effect, first.map(|i| light_name(scene, i)));
        }
        let mapped = self.effects.environment && scene.environment.is_some();
        self.need(Effect::environment_map, mapped.then(|| "environment".into()));
        self.need(
            Effect::weighed_lights,
            scene.weighed_lights.then(|| "several point, spot or directional lights".into()),
        );
        self.need(Effect::light_tree, scene.has_light_tree().then(|| "several lamps".into()));
        let large = scene.large_lamps && scene.lights.iter().any(Light::is_triangle);
        let first = || scene.lights.iter().position(|l| lights::is_large(scene, l));
        let moved = || "lamps that were or may come to be large".to_owned();
        self.need(Effect::large_lamps, large.then(|| first().map_or_else(moved, |i| light_name(scene, i))));
    }

    fn by_camera(&mut self, scene: &Scene) {
        self.need(Effect::lens, (scene.view.lens_radius > 0.0).then(|| "camera lens_radius".into()));
        self.need(Effect::orthographic, scene.view.orthographic.map(|_| "camera orthographic".into()));
    }

    fn by_geometry(&mut self, scene: &Scene) {
        let object_of = |triangle: usize| {
            // Below instances objects are counted from those of the first that places the mesh.
            let tree = scene.rig.trees.iter().find(|tree| tree.range.contains(&triangle));
            let places = |i: &&Instance| tree.is_some_and(|tree| i.root as usize == tree.nodes.start);
            let first = scene.instances.iter().find(places).map_or(0, |instance| instance.object);
            let object = scene.triangles.get(triangle).map(|t| (first + t.object) as usize);
            format!("object \"{}\"", object.and_then(|o| scene.names.objects.get(o)).map_or("", |name| name))
        };
        let shaded = |like: &dyn Fn(&Shading) -> bool| scene.shading.iter().position(like).map(object_of);
        self.need(Effect::smooth_normals, shaded(&|s| s.normal != geometry::FLAT));
        self.need(Effect::vertex_colors, shaded(&|s| s.attributes & ATTRIBUTE_COLORS != 0));
        let Effects { normal_maps, coat_normals, anisotropic, .. } = self.effects;
        if normal_maps || coat_normals || anisotropic {
            self.need(Effect::tangents, shaded(&|s| s.attributes & ATTRIBUTE_TANGENTS != 0));
        }
        let ball = scene.triangles.iter().position(|t| t.primitive & SPHERE != 0);
        self.need(Effect::spheres, ball.map(object_of));
        let [instances, triangles, texels] = [scene.instances.len(), scene.triangles.len(), scene.texels.len()];
        self.need(Effect::instances, (instances > 0).then(|| format!("{instances} instances")));
        self.need(Effect::dealt_triangles, (triangles >= DEALT_FROM).then(|| format!("{triangles} triangles")));
        self.need(Effect::many_texels, (texels > NARROW_TEXELS).then(|| format!("{texels} texels of textures")));
    }

    fn by_settings(&mut self, s: &Settings) {
        let mut need = |effect, on: bool, by: String| self.need(effect, on.then_some(by));
        need(Effect::indirect, s.max_depth > 2, format!("max_depth {}", s.max_depth));
        need(Effect::roulette, s.roulette_depth > 0, format!("roulette_depth {}", s.roulette_depth));
        need(Effect::clamp, s.clamp_indirect > 0.0, format!("clamp_indirect {}", s.clamp_indirect));
        need(Effect::sparse_light, s.indirect_stride > 1, format!("indirect_stride {}", s.indirect_stride));
        need(Effect::pixel_filter, s.filter != PixelFilter::Box, format!("filter {:?}", s.filter));
        need(Effect::independent_sampler, s.sampler == Sampler::Independent, "sampler independent".into());
        need(Effect::adaptive, !s.allocate.is_even(), format!("allocate {}", s.allocate.policy.name));
        let most = s.spp.max(s.allocate.max_spp);
        need(Effect::many_samples, most > 4096, format!("{most} samples of a pixel"));
    }
}

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

/// Whether a material calls for an effect. `sharp` says whether the scene has lights without extent.
fn material_needs(scene: &Scene, m: &Material, sharp: bool, effect: Effect) -> bool {
    let flagged =
        |flags: u32| m.textures().filter_map(|(_, t)| scene.textures.get(t as usize)).any(|t| t.flags & flags != 0);
    let is_masked = m.flags & MATERIAL_MASKED != 0;
    let is_veil = is_masked && m.opacity < 1.0 && m.alpha_cutoff == 0.0;
    let clear_wall = || sharp && (m.flags & MATERIAL_CLEAR_WALL != 0 || is_veil);
    let coated = m.kind == BSDF_METALLIC && m.clearcoat > 0.0;
    match effect {
        Effect::textures | Effect::bump_maps | Effect::normal_maps => m.textures().any(|(reader, _)| reader == effect),
        Effect::texture_modes => flagged(MODES),
        Effect::hdr_textures => flagged(TEXTURE_RGB9E5 | TEXTURE_FLOAT),
        Effect::second_uv => flagged(TEXTURE_SECOND_UV),
        Effect::alpha_cutoff => is_masked && m.alpha_cutoff > 0.0,
        // Shadow rays pass clear walls as they pass masks.
        Effect::alpha_masks => is_masked || clear_wall(),
        Effect::diffuse => matches!(m.kind, BSDF_DIFFUSE | BSDF_COATED),
        Effect::conductor => m.kind == BSDF_CONDUCTOR,
        Effect::dielectric => m.kind == BSDF_DIELECTRIC,
        Effect::coated => m.kind == BSDF_COATED,
        Effect::metallic => m.kind == BSDF_METALLIC,
        Effect::clearcoat => coated,
        Effect::coat_normals => coated && has_normal_map(m),
        Effect::thin_walls => m.kind == BSDF_METALLIC && m.transmission_factor > 0.0,
        Effect::clear_walls => clear_wall(),
        Effect::two_sided_lamps => m.flags & MATERIAL_EMITS_BEHIND != 0,
        Effect::anisotropic => m.anisotropy != 0.0,
        Effect::rough => is_rough(m, coated),
        Effect::smooth_interface => is_smooth(m, coated),
        Effect::beckmann => is_rough(m, coated) && m.flags & MATERIAL_GGX == 0,
        Effect::ggx => is_rough(m, coated) && m.flags & MATERIAL_GGX != 0,
        _ => false,
    }
}

fn is_rough(m: &Material, coated: bool) -> bool {
    m.kind != BSDF_DIFFUSE && m.alpha >= SMOOTH_ALPHA || coated && m.clearcoat_alpha >= SMOOTH_ALPHA
}

/// Whether some of it may be smooth: a roughness map may take any part of the surface below the line.
fn is_smooth(m: &Material, coated: bool) -> bool {
    let interface = m.kind != BSDF_DIFFUSE && (m.alpha < SMOOTH_ALPHA || m.roughness_texture != NONE);
    interface || coated && (m.clearcoat_alpha < SMOOTH_ALPHA || m.clearcoat_roughness_texture != NONE)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::load::material::Materials;

    #[test]
    fn what_an_instance_places_is_named() {
        let text = "[camera]\nposition = [0, 0, 6]\ntarget = [0, 0, 0]\n[environment]\nradiance = 1\n\
                    [[mesh]]\nshape = 'rectangle'\nname = 'floor'\n\
                    [[mesh]]\nshape = 'sphere'\nname = 'ball'\nmoving = true\n";
        let loaded = Scene::parse(std::path::Path::new("ball.toml"), text).unwrap();
        let (_, reasons) = effects(&loaded, &loaded.settings, false, false);
        let by = |wanted| reasons.iter().find(|(effect, _)| *effect == wanted).map(|(_, by)| by.as_str());
        assert_eq!(by(Effect::spheres), Some("object \"ball\""));
    }

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
