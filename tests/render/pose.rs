//! Tests that the picture of a pose is that of a scene which was loaded in it, bit for bit, whether trees were refitted or built.
use crate::poses::{MOMENTS, Moment, at, pose};
use crate::support::{assert_silent, gpu, render};
use tallow::gpu::{FrameResources, Gpu};
use tallow::layout::{Effects, PixelStats};
use tallow::render::{Outputs, Renderer};
use tallow::scene::{Loaded, MaterialChange, Pose};

const OUTPUTS: Outputs = Outputs { split_light: false, guides: true, counters: false };

fn fresh(gpu: &Gpu, scene: &Loaded) -> Vec<PixelStats> {
    let effects = Effects { large_lamps: at(&Moment::default()).large_lamps, ..*renderer(gpu, scene).effects() };
    render(gpu, &Renderer::specialised(gpu, scene, &scene.settings, OUTPUTS, effects).unwrap())
}

fn renderer(gpu: &Gpu, scene: &Loaded) -> Renderer {
    Renderer::new(gpu, scene, &scene.settings, OUTPUTS).unwrap()
}

fn handles(renderer: &Renderer) -> Vec<u64> {
    let s = renderer.scene();
    vec![
        s.nodes.raw().handle,
        s.triangles.raw().handle,
        s.shading.raw().handle,
        s.instances.raw().handle,
        s.materials.raw().handle,
        s.lights.raw().handle,
        s.light_table.raw().handle,
    ]
}

#[test]
fn a_pose_has_the_picture_of_a_scene_that_was_loaded_in_it() {
    let gpu = gpu();
    for rebuild_above in [f32::INFINITY, 0.0] {
        let mut scene = at(&Moment::default());
        let mut renderer = renderer(&gpu, &scene);
        let mut frame = FrameResources::new(&gpu).unwrap();
        let mut made = Vec::new();
        for (number, moment) in MOMENTS.iter().enumerate() {
            let pose = pose(&scene, moment, rebuild_above);
            let change = scene.apply(&pose).unwrap();
            gpu.run(&mut frame, |rec| renderer.update(rec, &scene, &change)).unwrap();
            let (found, expected) = (render(&gpu, &renderer), fresh(&gpu, &at(moment)));
            let off = found.iter().zip(&expected).filter(|(a, b)| a != b).count();
            assert_eq!(off, 0, "{moment:?}, built anew above {rebuild_above}: pixels differ");
            if number == 0 {
                assert!(found != fresh(&gpu, &at(&Moment { step: 3.0, ..*moment })), "control");
                made = handles(&renderer);
            }
            // A tree that is built anew may have more nodes than any before.
            let same = handles(&renderer) == made || rebuild_above == 0.0;
            assert!(same, "a buffer is made after the first frame");
        }
    }
    assert_silent(&gpu);
}

#[test]
fn an_effect_that_was_not_compiled_is_named() {
    let gpu = gpu();
    let mut scene = at(&Moment::default());
    let mut renderer = renderer(&gpu, &scene);
    let fade = MaterialChange { opacity: Some(0.5), ..MaterialChange::default() };
    let change = scene.apply(&Pose { materials: vec![(0, fade)], ..Pose::default() }).unwrap();
    let mut frame = FrameResources::new(&gpu).unwrap();
    let error = gpu.run(&mut frame, |rec| renderer.update(rec, &scene, &change)).unwrap_err();
    assert!(error.to_string().contains("\"alpha_masks\"") && error.exit_code() == 2, "{error}");
    let effects = Effects { alpha_masks: true, ..*renderer.effects() };
    let mut able = Renderer::specialised(&gpu, &scene, &scene.settings, OUTPUTS, effects).unwrap();
    gpu.run(&mut frame, |rec| able.update(rec, &scene, &change)).unwrap();
}
