//! What moving a scene costs beside a frame of one sample per pixel.
use anyhow::{Context, Result};
use std::path::Path;
use std::time::Instant;
use tallow::gpu::{FrameResources, Gpu, total_ms};
use tallow::profile::{median, wake};
use tallow::render::{Outputs, Renderer, traces_paths};
use tallow::report::table;
use tallow::scene::description::*;
use tallow::scene::{Loaded, Pose, Scene, Vertices};

/// Vertices along an edge of the cloth: 2 * 224^2 triangles.
const EDGE: u32 = 225;

/// Prints the costs of 100 instances in Crytek Sponza and of a cloth. Medians, after a first frame.
pub fn report(gpu: &Gpu, data: &Path, frames: u32) -> Result<()> {
    let mut hall = hall(&data.join("scenes/crytek-sponza/sponza.obj"))?;
    let mut rows = vec![measure("Sponza, 100 instances", gpu, &mut hall, frames, |_, n| Ok(rigid(n)))?];
    for (name, rebuild_above) in [("cloth, refitted", f32::INFINITY), ("cloth, built anew", 0.0)] {
        let mut scene = cloth()?;
        let deform = |scene: &Scene, n| Ok(Pose { rebuild_above, ..waves(scene, n)? });
        rows.push(measure(name, gpu, &mut scene, frames, deform)?);
    }
    println!("What moving costs, 640 x 360, 1 sample per pixel, max_depth 8");
    let head = ["scene", "pose", "record", "upload", "paths", "share of paths", "cost", "buffers made"];
    println!("{}", table::text(&head, &rows));
    println!("milliseconds; pose: hierarchies and lights on the host; upload and paths: on the device");
    println!("cost: of the refitted hierarchy over that when it was built, at the last frame\n");
    Ok(())
}

fn measure(
    name: &str,
    gpu: &Gpu,
    scene: &mut Loaded,
    frames: u32,
    pose: impl Fn(&Scene, u32) -> Result<Pose>,
) -> Result<Vec<String>> {
    let mut renderer = Renderer::new(gpu, scene, &scene.settings, Outputs::default())?;
    let mut frame = FrameResources::new(gpu)?;
    let (mut times, mut cost, mut handles) = ([const { Vec::new() }; 4], 1.0, Vec::new());
    for number in 0..=frames {
        let pose = pose(scene, number)?;
        let begun = Instant::now();
        let change = scene.apply(&pose)?;
        let posed = begun.elapsed().as_secs_f64() * 1e3;
        cost = change.deformed.first().map_or(cost, |d| d.cost);
        let mut recorded = 0.0;
        wake(gpu)?;
        let mut passes = gpu.run(&mut frame, |rec| {
            let begun = Instant::now();
            renderer.update(rec, scene, &change)?;
            recorded = begun.elapsed().as_secs_f64() * 1e3;
            Ok(())
        })?;
        for step in renderer.steps() {
            passes.extend(renderer.run(&mut frame, &step)?);
        }
        let of = |counts: fn(&str) -> bool| total_ms(passes.iter().filter(|p| counts(p.name)));
        let all = [posed, recorded, of(|name| name == "upload"), of(traces_paths)];
        times.iter_mut().zip(all).filter(|_| number > 0).for_each(|(times, ms)| times.push(ms));
        let s = renderer.scene();
        handles.push([s.nodes.raw().handle, s.triangles.raw().handle, s.instances.raw().handle, s.lights.raw().handle]);
    }
    let [posed, recorded, uploaded, paths] = times.map(|ms| median(&ms));
    let made = handles.windows(2).skip(1).filter(|pair| pair[0] != pair[1]).count();
    let share = (posed + recorded + uploaded) / paths;
    let ms = |v: f64| format!("{v:.3}");
    let numbers = [ms(posed), ms(recorded), ms(uploaded), ms(paths), format!("{:.2} %", 100.0 * share)];
    Ok([name.to_owned()].into_iter().chain(numbers).chain([format!("{cost:.3}"), made.to_string()]).collect())
}

fn film(loaded: Loaded) -> Loaded {
    loaded.with(|s| (s.width, s.height, s.spp, s.max_depth) = (640, 360, 1, 8))
}

fn hall(obj: &Path) -> Result<Loaded> {
    let mesh = |name: &str| MeshTable { name: Some(name.into()), ..MeshTable::default() };
    let place = |_| InstanceTable { mesh: "ball".into(), ..InstanceTable::default() };
    let description = Description {
        camera: Camera {
            position: Some([-118.0, 18.0, -3.0]),
            target: Some([0.0, 32.0, -2.0]),
            fov: Some(58.0),
            ..Camera::default()
        },
        environment: Some(EnvironmentTable { radiance: Some(Rgb([4.0, 5.2, 7.2])), ..EnvironmentTable::default() }),
        mesh: vec![
            MeshTable { file: Some(obj.to_owned()), ..mesh("hall") },
            MeshTable { shape: Some(Shape::Sphere), segments: Some(32), ..mesh("ball") },
        ],
        instance: (0..100).map(place).collect(),
        ..Description::default()
    };
    Ok(film(Scene::build(&description).context("Crytek Sponza")?))
}

/// Balls on circles through the nave.
fn rigid(number: u32) -> Pose {
    let place = |i: u32| {
        let (sin, cos) = (f64::from(number) * 0.05 + f64::from(i)).sin_cos();
        let (x, y, z) = (f64::from(i) * 2.0 - 100.0 + 3.0 * cos, 20.0 + 10.0 * sin, 8.0 * cos);
        (i as usize, Transform::try_from([1.5, 0., 0., x, 0., 1.5, 0., y, 0., 0., 1.5, z, 0., 0., 0., 1.]).unwrap())
    };
    Pose { instances: (0..100).map(place).collect(), ..Pose::default() }
}

fn vertices(number: u32) -> Vertices {
    let phase = number as f32 * 0.1;
    let point = |i: u32| [i % EDGE, i / EDGE].map(|v| v as f32 / (EDGE - 1) as f32 * 2.0 - 1.0);
    let height = |[x, z]: [f32; 2]| 0.3 * (5.0 * x + phase).sin() * (4.0 * z - phase).cos();
    let all = || (0..EDGE * EDGE).map(point);
    let positions = all().map(|[x, z]| [x, height([x, z]), z]).collect();
    let slope = |p: [f32; 2]| {
        let [x, z] = p;
        [
            -1.5 * (5.0 * x + phase).cos() * (4.0 * z - phase).cos(),
            1.0,
            1.2 * (5.0 * x + phase).sin() * (4.0 * z - phase).sin(),
        ]
    };
    Vertices { positions, normals: all().map(slope).collect(), ..Vertices::default() }
}

fn cloth() -> Result<Loaded> {
    let cell = |i: u32| {
        let a = i / (EDGE - 1) * EDGE + i % (EDGE - 1);
        [a, a + EDGE, a + 1, a + 1, a + EDGE, a + EDGE + 1]
    };
    let Vertices { positions, normals, .. } = vertices(0);
    let indices = (0..(EDGE - 1).pow(2)).flat_map(cell).collect();
    let data = Some(Mesh { positions, normals, indices, ..Mesh::default() });
    let mesh = MeshTable { name: Some("cloth".into()), data, moving: true, ..MeshTable::default() };
    let environment = Some(EnvironmentTable::default());
    Ok(film(Scene::build(&Description { mesh: vec![mesh], environment, ..Description::default() })?))
}

fn waves(scene: &Scene, number: u32) -> Result<Pose> {
    let mesh = scene.rig.mesh("cloth").context("the cloth moves")?;
    Ok(Pose { meshes: vec![(mesh, vertices(number))], ..Pose::default() })
}
