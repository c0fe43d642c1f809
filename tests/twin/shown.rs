//! Tests what smooth surfaces show, by the kernel and by its twin, in scenes where the answer is known.
use crate::support::{assert_silent, gpu, largest};
use crate::twin::Workplace;
use glam::Vec3;
use rayon::prelude::*;
use tallow::gpu::{FrameResources, Gpu};
use tallow::layout::Guide;
use tallow::render::{Outputs, Renderer, Step, frame_constants};
use tallow::scene::Loaded;
use tallow::twins::primary_hit::seen;

/// What every pixel shows, by the kernel and by the twin.
fn shown(gpu: &Gpu, scene: &Loaded) -> [Vec<Guide>; 2] {
    let outputs = Outputs { split_light: false, guides: true, counters: false };
    let renderer = Renderer::new(gpu, scene, &scene.settings, outputs).unwrap();
    renderer.run(&mut FrameResources::new(gpu).unwrap(), &Step::Start).unwrap();
    let frame = frame_constants(scene, &scene.settings).unwrap();
    let pixels = scene.settings.pixels() as u32;
    [
        renderer.film().tiles[0].seen.read().unwrap(),
        (0..pixels).into_par_iter().map(|p| seen(scene, &frame, p)).collect(),
    ]
}

fn material_of<'a>(scene: &'a Loaded, seen: &Guide) -> &'a str {
    scene.names.materials.get(seen.material as usize).map_or("the sky", String::as_str)
}

/// All pixels show the material `name`, at points whose component along `axis` is `at`, and by the same light from there.
fn shows(scene: &Loaded, seen: &[Vec<Guide>; 2], name: &str, axis: Vec3, at: f32) {
    assert_eq!(seen.each_ref().map(Vec::len), [scene.settings.pixels(); 2]);
    for (whose, guide) in ["kernel", "twin"].iter().zip(seen) {
        for g in guide {
            let material = material_of(scene, g);
            let place = Vec3::from(g.position).dot(axis);
            assert!(
                material == name && (place - at).abs() < 1e-3,
                "{whose}: {material} at {place}, not {name} at {at}"
            );
        }
    }
    let apart = |(a, b): (&Guide, &Guide)| Vec3::from(a.albedo).distance(b.albedo.into());
    let most = largest(seen[0].iter().zip(&seen[1]).map(apart));
    assert!(most < 1e-3, "{name}: albedos of kernel and twin are {most} apart");
}

/// A level plate at the origin, in which the camera sees the wall `above` mirrored, and through which the wall `below`.
fn plate(material: &str, camera: [f32; 3]) -> Loaded {
    Workplace::new().scene(&format!(
        "[film]\nwidth = 8\nheight = 8\n[camera]\nposition = {camera:?}\ntarget = [0.0, 0.0, 0.0]\nfov = 2.0\n\
         [[material]]\nname = 'plate'\n{material}\n[[material]]\nname = 'above'\ncolor = [0.8, 0.1, 0.1]\n\
         [[material]]\nname = 'below'\ncolor = [0.1, 0.1, 0.8]\n\
         [[mesh]]\nshape = 'rectangle'\nmaterial = 'plate'\ntransform = {{ rotate = [-90, 0, 0], scale = 3 }}\n\
         [[mesh]]\nshape = 'rectangle'\nmaterial = 'above'\ntransform = {{ scale = 20, translate = [0, 19.9, -15] }}\n\
         [[mesh]]\nshape = 'rectangle'\nmaterial = 'below'\ntransform = {{ scale = 20, translate = [0, -20.5, -5] }}\n"
    ))
}

/// Of index 1.5: at the cosine 0.1 it reflects .6 of the light, at 0.7 some hundredths.
#[test]
fn plates_of_glass_show_the_stronger_way() {
    let gpu = gpu();
    let pane = "type = 'metallic-roughness'\nmetallic = 0\nroughness = 0\ntransmission_factor = 1";
    for material in ["type = 'dielectric'", pane] {
        let grazing = plate(material, [0.0, 1.0, 10.0]);
        shows(&grazing, &shown(&gpu, &grazing), "above", Vec3::Z, -15.0);
    }
    let steep = plate(pane, [0.0, 10.0, 10.0]);
    shows(&steep, &shown(&gpu, &steep), "below", Vec3::Z, -5.0);
    assert_silent(&gpu);
}

/// A slope of 30 degrees that sends the mirror image of the camera, which stands 37 degrees off, by 7 degrees into the plate.
fn slope(material: &str) -> Loaded {
    Workplace::new().picture("slope.png", 8, |_, _| [191, 128, 238]).scene(&format!(
        "[film]\nwidth = 8\nheight = 8\n[camera]\nposition = [-6.0, 0.0, 8.0]\ntarget = [0.0, 0.0, 0.0]\nfov = 2.0\n\
         [[material]]\nname = 'plate'\n{material}\nnormal_map = 'slope.png'\n[[material]]\nname = 'floor'\n\
         [[material]]\nname = 'wall'\n[[mesh]]\nshape = 'rectangle'\nmaterial = 'plate'\ntransform = {{ scale = 2 }}\n\
         [[mesh]]\nshape = 'rectangle'\nmaterial = 'floor'\ntransform = {{ scale = 200, translate = [0, 0, -1] }}\n\
         [[mesh]]\nshape = 'rectangle'\nmaterial = 'wall'\n\
         transform = {{ scale = 20, rotate = [0, -90, 0], translate = [30, 0, 19.9] }}\n"
    ))
}

/// A metal's slope mirrors light once more, so that it shows the wall in front; what a conductor's slope sends into the surface is lost.
#[test]
fn slopes_of_metal_show_nothing_behind_them() {
    let gpu = gpu();
    let metal = slope("type = 'metallic-roughness'\nmetallic = 1\nroughness = 0");
    let seen = shown(&gpu, &metal);
    for g in seen.iter().flatten() {
        let material = material_of(&metal, g);
        assert!(material == "wall" && Vec3::from(g.normal).distance(Vec3::NEG_X) < 1e-3, "{material}: {g:?}");
        // Ten to the plate, and from there 30 along x on a way that rises by 7 degrees.
        assert!((g.depth - 40.2).abs() < 0.3, "{g:?}");
    }
    let conductor = slope("type = 'conductor'");
    shows(&conductor, &shown(&gpu, &conductor), "plate", Vec3::Z, 0.0);
    assert_silent(&gpu);
}
