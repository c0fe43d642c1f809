//! Rays that test each other's triangles find the bits that each finds alone, and so do rays whose traversal is tuned otherwise.
use crate::kernels::{Traversal, dealing, pictures, queries, shipped};
use crate::panes::panes;
use crate::support::{assert_silent, gpu, render, tuned_gpu};
use std::path::Path;
use tallow::allocate::policy as policy_of;
use tallow::gpu::{DeviceKind, Tuning};
use tallow::layout::*;
use tallow::render::{Outputs, Renderer, called_for};
use tallow::scene::{Loaded, Scene};

/// A hierarchy of many triangles, one with instances and masks, spheres among triangles, and panes.
fn scenes() -> [(&'static str, Loaded); 4] {
    [("bust", shipped("bust/scene.toml")), ("pictures", pictures()), ("balls", balls()), ("panes", panes())]
}

/// Spheres, some of them instances or masked, in and around triangles that are masked or not.
fn balls() -> Loaded {
    let mut text = "[camera]\nposition = [0.0, 0.5, 4.0]\ntarget = [0.0, 0.0, 0.0]\n[environment]\n\
                    [[material]]\nname = 'veil'\nopacity = 0.6\n[[material]]\nname = 'glass'\ntype = 'dielectric'\n\
                    [[mesh]]\nname = 'copied'\nshape = 'sphere'\ntransform = { scale = 0.3 }\n\
                    [[mesh]]\nname = 'shell'\nshape = 'sphere'\nsegments = 24\nmaterial = 'veil'\ntransform = { scale = 1.2 }\n"
        .to_owned();
    for i in 0..12 {
        let (angle, material) = (f64::from(i) * 0.55, ["veil", "glass", "default"][i as usize % 3]);
        let place = format!("translate = [{:.3}, {:.3}, {:.3}]", angle.cos(), 0.1 * angle, angle.sin());
        text += &match i % 4 {
            0 => format!("[[instance]]\nmesh = 'copied'\ntransform = {{ {place} }}\n"),
            _ => {
                format!("[[mesh]]\nshape = 'sphere'\nmaterial = '{material}'\ntransform = {{ scale = 0.3, {place} }}\n")
            }
        };
    }
    text += "[[material]]\nname = 'default'\n";
    Scene::parse(Path::new("balls.toml"), &text).unwrap().with(|s| (s.max_depth, s.spp) = (5, 4))
}

fn bits(hit: &RayHit) -> [u32; 5] {
    let [u, v] = hit.barycentric.map(f32::to_bits);
    [hit.t.to_bits(), hit.triangle, hit.instance, u, v]
}

#[test]
fn rays_find_the_same_hits_together() {
    let gpu = gpu();
    assert!(gpu.info().kind != DeviceKind::Cpu || dealing(&gpu).lanes > 0, "nothing is dealt on {:?}", gpu.info());
    for (name, scene) in scenes() {
        let effects = Effects { dealt_triangles: false, ..called_for(&scene, &scene.settings, Outputs::default()) };
        let together = Effects { dealt_triangles: true, ..effects };
        let kernels = [effects, together].map(|effects| Traversal::new(&gpu, &scene, effects));
        for count in [1, 31, 64, 65, 5000] {
            let rays = queries(&scene, count);
            let [alone, dealt] = kernels.each_ref().map(|kernel| kernel.hits(&rays, false));
            assert!(alone.iter().map(bits).eq(dealt.iter().map(bits)), "{name}: {count} closest hits");
            // Of several triangles any may stop a ray.
            let [alone, dealt] = kernels.each_ref().map(|kernel| kernel.hits(&rays, true));
            let stopped = |hits: &[RayHit]| hits.iter().map(|hit| hit.triangle != NONE).collect::<Vec<_>>();
            assert_eq!(stopped(&alone), stopped(&dealt), "{name}: {count} any hits");
        }
    }
    assert_silent(&gpu);
}

#[test]
fn rays_find_the_same_hits_however_they_are_tuned() {
    let usual = gpu();
    let switches = [
        ("native_bits", Tuning { native_bits: true, ..Tuning::CPU }),
        ("1 triangle a step", Tuning { triangles_a_step: 1, ..Tuning::CPU }),
        ("2 triangles a step", Tuning { triangles_a_step: 2, ..Tuning::CPU }),
    ];
    let switches = switches.map(|(name, tuning)| (name, tuned_gpu(tuning)));
    for (scene_name, scene) in scenes() {
        let effects = Effects { dealt_triangles: false, ..called_for(&scene, &scene.settings, Outputs::default()) };
        let rays = queries(&scene, 5000);
        let stopped = |hits: &[RayHit]| hits.iter().map(|hit| hit.triangle != NONE).collect::<Vec<_>>();
        let usual = Traversal::new(&usual, &scene, effects);
        let (closest, any) = (usual.hits(&rays, false), usual.hits(&rays, true));
        for (switch, gpu) in &switches {
            let tuned = Traversal::new(gpu, &scene, effects);
            let same = closest.iter().map(bits).eq(tuned.hits(&rays, false).iter().map(bits));
            assert!(same, "{scene_name}, {switch}: closest hits");
            assert_eq!(stopped(&any), stopped(&tuned.hits(&rays, true)), "{scene_name}, {switch}: any hits");
        }
    }
    switches.iter().for_each(|(_, gpu)| assert_silent(gpu));
}

/// From where they start, they would meet that surface again.
#[test]
fn rays_pass_the_surface_that_they_leave() {
    let gpus = [0, 2].map(|triangles_a_step| tuned_gpu(Tuning { triangles_a_step, ..Tuning::CPU }));
    for (name, scene) in scenes() {
        let effects = Effects { dealt_triangles: false, ..called_for(&scene, &scene.settings, Outputs::default()) };
        let rays = queries(&scene, 5000);
        let first = Traversal::new(&gpus[0], &scene, effects).hits(&rays, false);
        let [all, in_twos] = gpus.each_ref().map(|gpu| Traversal::behind(gpu, &scene, effects).hits(&rays, false));
        assert!(all.iter().map(bits).eq(in_twos.iter().map(bits)), "{name}");
        let surface = |hit: &RayHit| (hit.triangle, hit.instance);
        let met = first.iter().zip(&all).filter(|(first, _)| first.triangle != NONE);
        let again = met.filter(|(first, next)| surface(first) == surface(next)).count();
        assert!(if effects.spheres { again > 0 } else { again == 0 }, "{name}: {again}, which only spheres may be");
    }
    gpus.iter().for_each(assert_silent);
}

#[test]
fn pictures_have_the_same_bits_together() {
    let gpu = gpu();
    let eight_lanes = gpu.info().kind == DeviceKind::Cpu && gpu.info().subgroup_size == 8;
    assert!(!eight_lanes || gpu.deal().lanes == 8, "nothing is dealt on {:?}", gpu.info());
    // Where samples are placed, threads take their pixels from a list, whatever is traced: of two scenes.
    let policies = ["uniform", "variance", "variance", "uniform"];
    for ((name, mut scene), policy) in scenes().into_iter().zip(policies) {
        for (width, height) in [(7, 5), (33, 31)] {
            (scene.settings.width, scene.settings.height) = (width, height);
            scene.settings.allocate.policy = policy_of(policy).unwrap();
            let outputs = Outputs { split_light: true, ..Outputs::default() };
            let render = |dealt_triangles| {
                let effects = Effects { dealt_triangles, ..called_for(&scene, &scene.settings, outputs) };
                let renderer = Renderer::specialised(&gpu, &scene, &scene.settings, outputs, effects).unwrap();
                render(&gpu, &renderer)
            };
            let [alone, dealt] = [false, true].map(render);
            let same = bytemuck::cast_slice::<_, u8>(&alone) == bytemuck::cast_slice::<_, u8>(&dealt);
            assert!(same, "{name}, {width} x {height}, {policy}");
        }
    }
    assert_silent(&gpu);
}
