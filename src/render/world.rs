//! What ray queries trace through: the scene's meshes and the places where they are, as acceleration structures of the device.
use crate::error::Result;
use crate::gpu::{Aabb, Acceleration, Buffer, FrameResources, Gpu, Mesh, Placement, Recorder, Shapes};
use crate::layout::{Effects, SPHERE, Triangle};
use crate::scene::{Change, Scene};
use glam::Vec3;
use std::mem::offset_of;
use std::ops::Range;

/// The structures, and what they are built of besides the scene's triangles.
pub struct World {
    acceleration: Acceleration,
    /// What structures there are.
    parts: Vec<Part>,
    /// Beside each triangle, where the scene has spheres: the box of a sphere, or none.
    boxes: Option<Buffer<Aabb>>,
}

/// The triangles of a mesh, or the spheres among them: no structure can have both.
struct Part {
    /// Number of the mesh among [`Scene::meshes`].
    mesh: usize,
    shapes: Mesh,
}

impl World {
    /// Builds the structures; `None` on a device that does not trace by ray queries.
    ///
    /// # Errors
    /// [`crate::error::Error::Scene`] where instances do not lead to meshes, [`crate::error::Error::Device`].
    pub fn new(gpu: &Gpu, scene: &Scene, triangles: &Buffer<Triangle>, effects: &Effects) -> Result<Option<Self>> {
        if !gpu.traces_by_ray_query() {
            return Ok(None);
        }
        let boxes = || Buffer::from_slice(gpu, "boxes of spheres", &boxes(&scene.triangles));
        let boxes = effects.spheres.then(boxes).transpose()?;
        let (shapes, parts) = (shapes(triangles, boxes.as_ref())?, parts(scene, effects));
        let all: Vec<_> = (0..parts.len()).collect();
        let meshes = parts.iter().map(|part| part.shapes.clone()).collect();
        let room = placements(scene, &parts, scene.instances.len())?.len();
        let acceleration = Acceleration::new(gpu, shapes, meshes, room.max(1))?;
        let placements = placements(scene, &parts, scene.seen_instances())?;
        gpu.run(&mut FrameResources::new(gpu)?, |rec| rec.build(&acceleration, shapes, &all, &placements))?;
        Ok(Some(Self { acceleration, parts, boxes }))
    }

    /// What kernels trace through.
    pub fn acceleration(&self) -> &Acceleration {
        &self.acceleration
    }

    /// Records the builds that a change of the scene calls for, behind its upload: of the meshes whose triangles have moved, and of the
    /// places of all.
    ///
    /// # Errors
    /// As [`World::new`].
    pub fn update(
        &self,
        rec: &mut Recorder,
        scene: &Scene,
        triangles: &Buffer<Triangle>,
        change: &Change,
    ) -> Result<()> {
        if change.triangles.is_empty() && !change.instances {
            return Ok(());
        }
        let has_moved = |&part: &usize| {
            let range = &self.parts[part].shapes.range;
            change.triangles.iter().any(|moved| moved.start < range.end && range.start < moved.end)
        };
        let moved: Vec<_> = (0..self.parts.len()).filter(has_moved).collect();
        let shapes = shapes(triangles, self.boxes.as_ref())?;
        rec.build(&self.acceleration, shapes, &moved, &placements(scene, &self.parts, scene.seen_instances())?)
    }
}

fn shapes<'a>(triangles: &'a Buffer<Triangle>, boxes: Option<&'a Buffer<Aabb>>) -> Result<Shapes<'a>> {
    let corners = [offset_of!(Triangle, v0), offset_of!(Triangle, v1), offset_of!(Triangle, v2)];
    Shapes::new(triangles, corners, boxes)
}

fn parts(scene: &Scene, effects: &Effects) -> Vec<Part> {
    let once = effects.clear_walls; // they dim light each time that a ray comes to them
    let of_mesh = |(mesh, range): (usize, Range<usize>)| {
        let in_boxes = |i: &usize| effects.spheres && is_sphere(&scene.triangles[*i]);
        // One structure of all spheres, from the first to the last: a ray pays for each structure whose box it meets, and triangles
        // between spheres have empty boxes.
        let ends = [range.clone().find(in_boxes), range.clone().rfind(in_boxes)];
        let spheres = ends[0].zip(ends[1]).map(|(first, last)| Mesh { range: first..last + 1, of_boxes: true, once });
        // What spheres are told by is no triangle that is seen, and lies among those of the mesh.
        let has_triangles = !range.clone().all(|i| in_boxes(&i));
        let triangles = has_triangles.then_some(Mesh { range, of_boxes: false, once });
        triangles.into_iter().chain(spheres).map(|shapes| Part { mesh, shapes }).collect::<Vec<_>>()
    };
    scene.meshes().into_iter().enumerate().flat_map(of_mesh).collect()
}

fn is_sphere(t: &Triangle) -> bool {
    t.primitive & SPHERE != 0
}

/// A box around each sphere. Rounding of its faces, and of where a ray meets them, must not cut the sphere. A triangle after it has the
/// point in its middle: beside boxes that are no numbers, which Vulkan calls inactive, lavapipe lost spheres.
fn boxes(triangles: &[Triangle]) -> Vec<Aabb> {
    const MARGIN: f32 = 1e-5;
    let mut middle = [0.0; 3];
    let around = |t: &Triangle| {
        if !is_sphere(t) {
            let [x, y, z] = middle;
            return [x, y, z, x, y, z];
        }
        middle = t.v0;
        let (centre, radius) = (Vec3::from(t.v0), Vec3::from(t.v1).length());
        let reach = (radius + centre.length() * 0.1) * MARGIN + radius;
        let [low, high] = [centre - reach, centre + reach].map(|corner| corner.to_array());
        [low[0], low[1], low[2], high[0], high[1], high[2]]
    };
    triangles.iter().map(around).collect()
}

/// Where the parts of meshes are, for so many of the instances; a scene of one level is one mesh that lies where it is.
fn placements(scene: &Scene, parts: &[Part], instances: usize) -> Result<Vec<Placement>> {
    const STILL: [[f32; 4]; 3] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    let rows = |number: usize| scene.instances.get(number).map_or(STILL, |i| [i.world0, i.world1, i.world2]);
    let mut meshes = if scene.instances.is_empty() { vec![0] } else { scene.meshes_of_instances()? };
    meshes.truncate(instances.max(usize::from(scene.instances.is_empty())));
    let mut parts_of = vec![Vec::new(); scene.meshes().len()];
    (0..).zip(parts).for_each(|(index, part)| parts_of[part.mesh].push(index));
    let place = |(number, mesh): (usize, usize)| {
        let parts = parts_of.get(mesh).into_iter().flatten();
        parts.map(move |&mesh| Placement { rows: rows(number), mesh, number: number as u32 }).collect::<Vec<_>>()
    };
    Ok(meshes.into_iter().enumerate().flat_map(place).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::{Outputs, called_for};
    use std::path::Path;

    /// The structures of a scene of so many cubes and spheres in turn: whether each is of boxes, and its triangles.
    fn structures(text: &str) -> (Scene, Vec<(bool, Range<usize>)>) {
        let loaded = Scene::parse(Path::new("scene.toml"), text).unwrap();
        let effects = called_for(&loaded, &loaded.settings, Outputs::default());
        let parts = parts(&loaded, &effects).into_iter().map(|part| (part.shapes.of_boxes, part.shapes.range));
        (loaded.scene.clone(), parts.collect())
    }

    #[test]
    fn spheres_among_triangles_have_one_structure() {
        let one = |shape: &str, x: usize| {
            format!("[[mesh]]\nshape = '{shape}'\ntransform = {{ translate = [{x}, 0, 0], scale = 0.3 }}\n")
        };
        let row = |shape: &str| (0..20).map(|x| one(shape, x)).collect::<String>();
        let (scene, both) = structures(&(0..20).map(|x| one("cube", x) + &one("sphere", x)).collect::<String>());
        let runs = scene.triangles.chunk_by(|a, b| is_sphere(a) == is_sphere(b)).count();
        assert!(runs > 4, "control: the hierarchy has them in turn, in {runs} runs");
        let [(false, triangles), (true, spheres)] = &both[..] else { panic!("{both:?}") };
        assert_eq!(triangles, &(0..260));
        let within = |i: usize| spheres.contains(&i);
        assert!(scene.triangles.iter().enumerate().all(|(i, t)| !is_sphere(t) || within(i)), "{spheres:?}");
        assert!([spheres.start, spheres.end - 1].into_iter().all(|i| is_sphere(&scene.triangles[i])), "{spheres:?}");
        assert_eq!(structures(&row("sphere")).1, [(true, 0..20)]);
        assert_eq!(structures(&row("cube")).1, [(false, 0..240)]);
    }
}
