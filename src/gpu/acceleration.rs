//! Acceleration structures: the hierarchies that a device makes by itself and traces ray queries through. There is one for each mesh,
//! and one over the places where meshes are.
mod input;

use super::ray_query::{MOST_NUMBERS, RayQueries};
use super::{Buffer, Gpu, Location};
use crate::error::{Error, Result};
use ash::vk;
use input::Record;
pub use input::{Aabb, Mesh, Shapes};
pub(super) use input::{Input, address};
use std::sync::Arc;

/// Structures begin at multiples of so many bytes.
const ALIGNMENT: u64 = 256;

/// A mesh where it is placed.
#[derive(Clone, Copy, Debug)]
pub struct Placement {
    /// Rows of world_from_object.
    pub rows: [[f32; 4]; 3],
    /// Index of the mesh.
    pub mesh: usize,
    /// The number that rays find it by.
    pub number: u32,
}

/// The structures of a scene. They are built when a renderer is made, and again after a change.
pub struct Acceleration {
    pub(super) handles: Arc<Handles>,
    pub(super) meshes: Vec<Mesh>,
    /// What the structure over the copies is built of.
    pub(super) records: Buffer<Record>,
}

/// The Vulkan objects, which frames keep until their work is done.
pub(super) struct Handles {
    pub gpu: Gpu,
    pub meshes: Vec<vk::AccelerationStructureKHR>,
    pub top: vk::AccelerationStructureKHR,
    /// What holds all of them.
    pub storage: Buffer<u32>,
}

impl Acceleration {
    /// Makes room for the structures of these meshes, runs of `shapes`, and of at most so many copies of them.
    ///
    /// # Errors
    /// [`Error::Device`] on a device that traces otherwise, for more copies or larger meshes than it allows, and when
    /// memory is out.
    pub(crate) fn new(gpu: &Gpu, shapes: Shapes, meshes: Vec<Mesh>, copies: usize) -> Result<Self> {
        let queries = gpu.ray_queries()?;
        check_most(copies, "instances", queries.most_copies)?;
        let largest = meshes.iter().map(|mesh| mesh.range.len()).max().unwrap_or(0);
        check_most(largest, "triangles in one mesh", queries.most_shapes)?;
        shapes.check(gpu, &meshes)?;
        let records = Buffer::new(gpu, "copies of meshes", copies, Location::Device)?;
        let inputs = meshes.iter().map(|mesh| Input::of_mesh(gpu, shapes, mesh));
        let inputs: Vec<_> = inputs.chain([Input::of_copies(gpu, &records, copies)]).collect();
        let sizes: Vec<_> = inputs.iter().map(|input| input.sizes(queries).acceleration_structure_size).collect();
        let whole: u64 = sizes.iter().map(|size| size.next_multiple_of(ALIGNMENT)).sum();
        let storage = Buffer::new(gpu, "acceleration structures", (whole / 4) as usize, Location::Device)?;
        // From here on, Drop cleans up if a line below fails.
        let (made, top) = Default::default();
        let mut handles = Handles { gpu: gpu.clone(), meshes: made, top, storage };
        let mut offset = 0;
        for (input, size) in inputs.iter().zip(sizes) {
            let made = input.create(queries, handles.storage.bound().buffer, offset..offset + size)?;
            match input.kind {
                vk::AccelerationStructureTypeKHR::TOP_LEVEL => handles.top = made,
                _ => handles.meshes.push(made),
            }
            offset += size.next_multiple_of(ALIGNMENT);
        }
        Ok(Self { handles: Arc::new(handles), meshes, records })
    }

    /// Bytes of device memory that it takes.
    pub fn bytes(&self) -> u64 {
        self.handles.storage.raw().size + self.records.raw().size
    }

    /// As Vulkan has it.
    ///
    /// # Errors
    /// [`Error::Device`] where the mesh begins too far on.
    pub(super) fn record_of(&self, queries: &RayQueries, copy: &Placement) -> Result<Record> {
        const EVERY_RAY: u32 = 0xff << 24;
        let (first, structure) = (self.meshes[copy.mesh].range.start, self.handles.meshes[copy.mesh]);
        check_most(first, "triangles before those of a mesh", MOST_NUMBERS - 1)?;
        let info = vk::AccelerationStructureDeviceAddressInfoKHR::default().acceleration_structure(structure);
        // SAFETY: a live structure of this device.
        let address = unsafe { queries.structures.get_acceleration_structure_device_address(&info) };
        let mut record = [0; 16];
        record[..12].copy_from_slice(bytemuck::cast_slice(&copy.rows));
        record[12..].copy_from_slice(&[copy.number | EVERY_RAY, first as u32, address as u32, (address >> 32) as u32]);
        Ok(record)
    }
}

impl Drop for Handles {
    fn drop(&mut self) {
        let Ok(queries) = self.gpu.ray_queries() else { return };
        // SAFETY: made on this device, not in use, since frames keep them until their work is done; destroyed once.
        self.gpu.0.free(|_| unsafe {
            self.meshes.iter().for_each(|mesh| queries.structures.destroy_acceleration_structure(*mesh, None));
            queries.structures.destroy_acceleration_structure(self.top, None);
        });
    }
}

/// # Errors
/// [`Error::Device`] where more were found than ray queries take.
fn check_most(found: usize, what: &str, most: u64) -> Result<()> {
    match found as u64 <= most {
        true => Ok(()),
        false => Err(Error::Device(format!(
            "{found} {what}, of which ray queries take at most {most} on this device: choose the tracing \"compute\""
        ))),
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn what_ray_queries_have_no_room_for_is_refused() {
        let guaranteed = (1 << 24) - 1;
        super::check_most(guaranteed, "instances", guaranteed as u64).unwrap();
        let why = super::check_most(guaranteed + 1, "instances", guaranteed as u64).unwrap_err().to_string();
        assert!(why.contains("16777216 instances") && why.contains("at most 16777215"), "{why}");
    }
}
