//! Tests that the picture of a pose is that of a scene which was loaded in it, bit for bit, whether trees were refitted or built.
use crate::poses::{MOMENTS, Moment, at, pose};
use crate::support::{assert_silent, gpu, render, stats};
use std::path::Path;
use tallow::error::Error;
use tallow::gpu::{FrameResources, Gpu};
use tallow::layout::{Effects, PixelStats, Texture};
use tallow::render::{Moves, Outputs, Renderer, Reproject, called_for};
use tallow::scene::description::{LightTable, Rgb, Transform};
use tallow::scene::{Change, Environment, EnvironmentChange, Loaded, MaterialChange, Pose, Scene};

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
        s.light_nodes.raw().handle,
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
    assert!(
        error.to_string().contains("\"alpha_masks\"")
            && error.to_string().contains("called_for")
            && error.exit_code() == 2,
        "{error}"
    );
    let solid = MaterialChange { opacity: Some(1.0), ..MaterialChange::default() };
    let mut back = change.clone();
    back.add(scene.apply(&Pose { materials: vec![(0, solid)], ..Pose::default() }).unwrap()).unwrap();
    gpu.run(&mut frame, |rec| renderer.update(rec, &scene, &back)).unwrap();
    assert!(render(&gpu, &renderer) == fresh(&gpu, &at(&Moment::default())));
    let change = scene.apply(&Pose { materials: vec![(0, fade)], ..Pose::default() }).unwrap();
    let effects = Effects { alpha_masks: true, clear_walls: true, ..*renderer.effects() };
    let mut able = Renderer::specialised(&gpu, &scene, &scene.settings, OUTPUTS, effects).unwrap();
    gpu.run(&mut frame, |rec| able.update(rec, &scene, &change)).unwrap();
}

#[test]
fn what_is_dark_when_the_renderer_is_made_can_be_switched_on() {
    let gpu = gpu();
    let text = DARK.replace("intensity = 4", "intensity = 0");
    let scene =
        || Scene::parse(Path::new("scene.toml"), &text).unwrap().with(|s| (s.width, s.height, s.spp) = (24, 16, 2));
    let lit = Rgb([4.0; 3]);
    let bulb = LightTable { position: Some([2.0, 3.0, 1.0]), intensity: Some(lit), ..LightTable::default() };
    let dawn = EnvironmentChange { radiance: Some([1.0; 3]), rotation: None };
    let mut frame = FrameResources::new(&gpu).unwrap();
    for pose in
        [Pose { lights: vec![(0, bulb)], ..Pose::default() }, Pose { environment: Some(dawn), ..Pose::default() }]
    {
        let mut scene = scene();
        let mut renderer = renderer(&gpu, &scene);
        let dark = render(&gpu, &renderer);
        let change = scene.apply(&pose).unwrap();
        gpu.run(&mut frame, |rec| renderer.update(rec, &scene, &change)).unwrap();
        let found = render(&gpu, &renderer);
        assert!(found != dark && found == fresh(&gpu, &scene), "{pose:?}");
    }
}

/// Lamps enough for a tree, and no other light: a renderer is made, and a moved one updated, for a moment at which all are dark.
#[test]
fn a_moment_at_which_every_lamp_is_dark_is_rendered() {
    let gpu = gpu();
    let lamp = |x: i32| {
        format!(
            "[[mesh]]\nshape = 'rectangle'\nmaterial = 'lamp'\ntransform = {{ rotate = [90, 0, 0], translate = [{x}, 3, 0] }}\n"
        )
    };
    let text = format!(
        "[[material]]\nname = 'lamp'\nemission = 5\n[[mesh]]\nshape = 'cube'\n{}",
        [-3, 0, 3].map(lamp).concat()
    );
    let mut scene =
        Scene::parse(Path::new("scene.toml"), &text).unwrap().with(|s| (s.width, s.height, s.spp) = (24, 16, 2));
    let [dark, lit] = [0.0, 5.0].map(|emission| MaterialChange { emission: Some([emission; 3]), ..Default::default() });
    let mut moved = renderer(&gpu, &scene);
    let bright = render(&gpu, &moved);
    assert!(
        scene.light_nodes.len() > 1 && bright.iter().any(|stats| stats.mean[0] > 0.0),
        "control: a tree, and light"
    );
    let mut frame = FrameResources::new(&gpu).unwrap();
    for (change, is_dark) in [(dark, true), (lit, false)] {
        let change = scene.apply(&Pose { materials: vec![(0, change)], ..Pose::default() }).unwrap();
        gpu.run(&mut frame, |rec| moved.update(rec, &scene, &change)).unwrap();
        assert_eq!(scene.light_nodes[0].power, if is_dark { 0.0 } else { 1.0 });
        let found = render(&gpu, &moved);
        assert!(found == render(&gpu, &renderer(&gpu, &scene)), "one made now; dark: {is_dark}");
        assert!(if is_dark { found.iter().all(|stats| stats.mean == [0.0; 3]) } else { found == bright });
    }
    assert_silent(&gpu);
}

/// A panel above a cube and a dark sky, neither of which shines yet, and a light without soft shadows.
const DARK: &str = "[environment]\nradiance = 0\n[[material]]\nname = 'panel'\n[[material]]\nname = 'grey'\n\
    [[mesh]]\nshape = 'rectangle'\nmaterial = 'panel'\ntransform = { rotate = [90, 0, 0], translate = [0, 3, 0] }\n\
    [[mesh]]\nshape = 'cube'\nmaterial = 'grey'\nmoving = true\n\
    [[light]]\ntype = 'point'\nposition = [2, 3, 1]\nintensity = 4\n";

#[test]
fn lamps_and_sky_that_come_to_shine_stay_out_of_sharp_direct_light() {
    let (gpu, split) = (gpu(), Outputs { split_light: true, ..OUTPUTS });
    let load = || {
        let loaded = Scene::parse(std::path::Path::new("scene.toml"), DARK).unwrap();
        loaded.with(|s| (s.width, s.height, s.spp) = (24, 16, 2))
    };
    let direct = |renderer: &Renderer| {
        render(&gpu, renderer);
        renderer.film().tiles[0].light.read().unwrap().iter().map(|light| light.direct).collect::<Vec<_>>()
    };
    let dawn = EnvironmentChange { radiance: Some([1.0; 3]), rotation: None };
    let glow = MaterialChange { emission: Some([9.0; 3]), ..MaterialChange::default() };
    let poses =
        [Pose { environment: Some(dawn), ..Pose::default() }, Pose { materials: vec![(0, glow)], ..Pose::default() }];
    let mut lit = load();
    poses.iter().for_each(|pose| drop(lit.apply(pose).unwrap()));
    let all = called_for(&lit, &lit.settings, split);
    let mut frame = FrameResources::new(&gpu).unwrap();
    for pose in poses {
        let mut scene = load();
        let with = |effects, outputs| Renderer::specialised(&gpu, &scene, &scene.settings, outputs, effects).unwrap();
        let without = Effects { soft_light: false, ..all };
        let (mut able, mut unable, mut whole) = (with(all, split), with(without, split), with(without, OUTPUTS));
        let change = scene.apply(&pose).unwrap();
        let mut update = |renderer: &mut Renderer| gpu.run(&mut frame, |rec| renderer.update(rec, &scene, &change));
        update(&mut able).unwrap();
        update(&mut whole).unwrap();
        let error = update(&mut unable).unwrap_err().to_string();
        assert!(error.contains("\"soft_light\""), "{error}");
        let new = Renderer::specialised(&gpu, &scene, &scene.settings, split, all).unwrap();
        assert!(able.sharp_direct() && direct(&able) == direct(&new));
        let mixed = Renderer::specialised(&gpu, &scene, &scene.settings, split, without).unwrap();
        assert!(direct(&mixed) != direct(&new), "control: what shines now is soft");
    }
    assert_silent(&gpu);
}

/// A renderer that was not told of a change would show a scene of two poses.
#[test]
fn a_change_that_a_renderer_was_not_told_of_is_found() {
    let gpu = gpu();
    let mut scene = at(&Moment::default());
    let mut renderer = renderer(&gpu, &scene);
    let [first, second] = [0, 1].map(|number| {
        let pose = pose(&scene, &MOMENTS[number], 0.0);
        scene.apply(&pose).unwrap()
    });
    let mut frame = FrameResources::new(&gpu).unwrap();
    let mut update = |renderer: &mut Renderer, scene: &Scene, change: &Change| {
        gpu.run(&mut frame, |rec| renderer.update(rec, scene, change)).map(drop)
    };
    for (change, what) in [(&second, "of which the first is not known"), (&first, "behind which there is another")] {
        let told = update(&mut renderer, &scene, change).expect_err(what);
        let text = told.to_string();
        assert!(
            matches!(told, Error::Usage(_)) && text.contains("Change::add") && text.contains("Change::everything"),
            "{text}"
        );
    }
    assert!(render(&gpu, &renderer) == fresh(&gpu, &at(&Moment::default())), "nothing has changed");
    let mut both = first.clone();
    both.add(second.clone()).unwrap();
    update(&mut renderer, &scene, &both).unwrap();
    assert!(render(&gpu, &renderer) == fresh(&gpu, &scene));
    update(&mut renderer, &scene, &second).expect("what is known is told again");
    let told = second.clone().add(first.clone()).unwrap_err().to_string();
    assert!(told.contains("in their order"), "{told}");
    // A pose that changes nothing need not be told.
    let still = scene.apply(&Pose::default()).unwrap();
    assert_eq!(still.serials, None);
    let pose = pose(&scene, &MOMENTS[2], 0.0);
    let mut other = scene.clone();
    let (here, there) = (scene.apply(&pose).unwrap(), other.apply(&pose).unwrap());
    assert!(update(&mut renderer, &scene, &there).is_err(), "of a clone that went its own way");
    update(&mut renderer, &scene, &here).unwrap();
    assert!(update(&mut renderer, &other, &there).is_err());
    update(&mut renderer, &other, &Change::everything(&other)).unwrap();
    assert!(render(&gpu, &renderer) == fresh(&gpu, &scene));
    assert_silent(&gpu);
}

#[test]
fn a_recording_that_was_thrown_away_is_made_up_for() {
    let gpu = gpu();
    let mut scene = at(&Moment::default());
    let mut renderer = renderer(&gpu, &scene);
    renderer.keep_history(Reproject::default(), Moves::Scene).unwrap();
    render(&gpu, &renderer);
    let (mut frame, before) = (FrameResources::new(&gpu).unwrap(), handles(&renderer));
    for moment in &MOMENTS[1..3] {
        let pose = pose(&scene, moment, 0.0);
        let change = scene.apply(&pose).unwrap();
        let thrown_away = gpu.run(&mut frame, |rec| {
            renderer.update(rec, &scene, &change)?;
            renderer.steps_on().try_for_each(|step| renderer.record(rec, &step))?;
            Err(Error::Usage("thrown away".into()))
        });
        assert!(thrown_away.is_err_and(|e| e.to_string() == "thrown away"));
    }
    assert_ne!(handles(&renderer)[0], before[0], "control: the nodes have outgrown their buffer");
    gpu.run(&mut frame, |rec| {
        renderer.update(rec, &scene, &Change::everything(&scene))?;
        renderer.steps_on().try_for_each(|step| renderer.record(rec, &step))
    })
    .unwrap();
    assert!(stats(&renderer) == fresh(&gpu, &scene), "the frame is that of a new renderer, and carries nothing");
    // From here on changes are enough again.
    let pose = pose(&scene, &MOMENTS[5], f32::INFINITY);
    let change = scene.apply(&pose).unwrap();
    gpu.run(&mut frame, |rec| renderer.update(rec, &scene, &change)).unwrap();
    assert!(render(&gpu, &renderer) == fresh(&gpu, &scene));
    assert_silent(&gpu);
}

#[test]
fn a_scene_that_needs_a_deeper_stack_is_told_what_to_do() {
    let gpu = gpu();
    let text = "[film]\nwidth = 8\nheight = 8\n[environment]\nradiance = 1\n[[mesh]]\nshape = 'rectangle'\n";
    let (small, other) = (Scene::parse(Path::new("small.toml"), text).unwrap(), at(&Moment::default()));
    assert!(other.stack > small.stack, "control");
    let [effects, own] = [&other, &small].map(|scene| called_for(scene, &small.settings, OUTPUTS));
    let mut renderer = Renderer::specialised(&gpu, &small, &small.settings, OUTPUTS, effects.or(own)).unwrap();
    let mut frame = FrameResources::new(&gpu).unwrap();
    let told = gpu.run(&mut frame, |rec| renderer.update(rec, &other, &Change::everything(&other))).unwrap_err();
    let told = told.to_string();
    assert!(told.contains("make a new renderer, or apply the pose to the scene that it was made for"), "{told}");
}

#[test]
fn a_scene_that_a_new_renderer_would_refuse_or_hold_otherwise_is_refused() {
    let gpu = gpu();
    let scene = at(&Moment::default());
    let mut renderer = renderer(&gpu, &scene);
    let before = render(&gpu, &renderer);
    type Edit = fn(&mut Scene);
    let edits: [(&str, Edit); 5] = [
        ("triangle 0 names material 9999", |s| s.triangles[0].material = 9999),
        ("triangles, and this renderer", |s| s.triangles.push(s.triangles[0])),
        ("materials, and this renderer", |s| s.materials.push(s.materials[0])),
        ("1 textures, and this renderer was made for 0: make a new renderer", |s| s.textures.push(Texture::default())),
        ("8 columns of texels in its environment", |s| {
            s.environment = Some(Environment { width: 8, height: 4, ..Environment::default() });
        }),
    ];
    let mut frame = FrameResources::new(&gpu).unwrap();
    for (part, edit) in edits {
        let mut edited = scene.scene.clone();
        edit(&mut edited);
        let update = gpu.run(&mut frame, |rec| renderer.update(rec, &edited, &Change::everything(&edited)));
        let told = update.expect_err(part).to_string();
        assert!(told.contains(part) && render(&gpu, &renderer) == before, "{told}");
    }
}

#[test]
fn a_camera_that_is_no_number_is_a_fault_of_its_own() {
    let gpu = gpu();
    let scene = at(&Moment::default());
    let mut renderer = renderer(&gpu, &scene);
    let mut camera = scene.camera([48, 32]).unwrap();
    camera.position[1] = f32::NAN;
    let error = renderer.set_camera(camera).unwrap_err();
    let said = error.to_string();
    assert!(said.starts_with("camera: ") && !said.contains("arrays") && error.exit_code() == 2, "{said}");
}

/// A camera without a place frames the scene, also as that moves; one that an engine has set stays where it is.
#[test]
fn a_camera_that_was_set_stays_where_poses_move_the_frame() {
    let gpu = gpu();
    let text = "[film]\nwidth = 16\nheight = 12\n[render]\nspp = 2\nmax_depth = 2\n[environment]\nradiance = 1\n[[mesh]]\nname = 'box'\n\
                shape = 'cube'\n[[instance]]\nname = 'door'\nmesh = 'box'\n[[instance]]\nmesh = 'box'\n";
    let Loaded { mut scene, settings, .. } = Scene::parse(Path::new("s.toml"), text).unwrap();
    let mut renderer = Renderer::new(&gpu, &scene, &settings, Outputs::default()).unwrap();
    let mut frame = FrameResources::new(&gpu).unwrap();
    let mut moved = |renderer: &mut Renderer, x: f64| {
        let at = Transform::try_from([1., 0., 0., x, 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.]).unwrap();
        let change = scene.apply(&Pose { instances: vec![(0, at)], ..Pose::default() }).unwrap();
        assert!(change.framing && !change.camera, "{change:?}");
        gpu.run(&mut frame, |rec| renderer.update(rec, &scene, &change)).unwrap();
        (render(&gpu, renderer), scene.camera([16, 12]).unwrap())
    };
    let (framed, own) = moved(&mut renderer, 4.0);
    renderer.set_camera(own).unwrap();
    assert!(render(&gpu, &renderer) == framed, "it follows the frame while none was set");
    let (kept, other) = moved(&mut renderer, 40.0);
    renderer.set_camera(own).unwrap();
    assert!(render(&gpu, &renderer) == kept && own != other, "it stays");
    renderer.set_camera(other).unwrap();
    assert!(render(&gpu, &renderer) != kept, "control: the frame has moved");
    assert_silent(&gpu);
}
