//! What acceleration structures are built of, in the form in which Vulkan takes it.
use crate::error::{Error, Result};
use crate::gpu::ray_query::RayQueries;
use crate::gpu::{At, Bound, Buffer, Gpu, Location, Untyped};
use ash::vk;
use bytemuck::Pod;
use std::ops::Range;

/// A box around something that is no triangle: lower bounds, then upper ones. One whose first number is NaN is not there.
pub type Aabb = [f32; 6];
/// Vulkan's record of a copy: a matrix of three rows of four floats, number and mask, first triangle and flags, address.
pub type Record = [u32; 16];

/// What meshes are made of: each is a range of these.
#[derive(Clone, Copy)]
pub struct Shapes<'a> {
    triangles: Bound<'a>,
    /// Bytes from the start of a record to its first corner.
    corner: u64,
    /// Bytes from a corner to the next, also of the next triangle.
    stride: u64,
    boxes: Option<Bound<'a>>,
}

impl<'a> Shapes<'a> {
    /// Triangles whose `corners` are so many bytes from the start of a record, and beside each a box or none.
    ///
    /// # Errors
    /// [`Error::Usage`] where the corners of all records do not follow each other at equal distances.
    pub fn new<T: Pod>(triangles: &'a Buffer<T>, corners: [usize; 3], boxes: Option<&'a Buffer<Aabb>>) -> Result<Self> {
        let (size, stride) = (size_of::<T>(), size_of::<T>() / 3);
        let even = size == 3 * stride && corners.windows(2).all(|pair| pair[1] == pair[0] + stride);
        let [corner, stride] = [corners[0], stride].map(|bytes| bytes as u64);
        let what = "ray queries need records of triangles that have their corners at equal distances";
        match even {
            true => Ok(Self { triangles: triangles.bound(), corner, stride, boxes: boxes.map(Buffer::bound) }),
            false => Err(Error::Usage(what.into())),
        }
    }

    pub(in crate::gpu) fn buffers(&self) -> Vec<Bound<'a>> {
        [Some(self.triangles), self.boxes].into_iter().flatten().collect()
    }

    /// # Errors
    /// [`Error::Usage`] where there are fewer of them than meshes have, or `gpu` cannot build of them.
    pub(in crate::gpu) fn check(&self, gpu: &Gpu, meshes: &[Mesh]) -> Result<()> {
        for Bound { buffer, .. } in self.buffers() {
            gpu.owns(&buffer.name, &buffer.gpu)?;
            if buffer.location != Location::Device {
                return Err(Error::Usage(format!("buffer \"{}\": ray queries need it in device memory", buffer.name)));
            }
        }
        let boxes = self.boxes.map_or(u64::MAX, |boxes| boxes.size / size_of::<Aabb>() as u64);
        let count = boxes.min(self.triangles.size / (3 * self.stride));
        match meshes.iter().map(|mesh| mesh.range.end as u64).max().filter(|end| *end > count) {
            Some(end) => Err(Error::Usage(format!("a mesh ends at triangle {end}, and there are {count}"))),
            None => Ok(()),
        }
    }
}

/// A run of shapes that has a structure of its own, which is either of triangles or of boxes.
#[derive(Clone, Debug)]
pub struct Mesh {
    /// Where it lies among the records of the triangles, and of the boxes beside them.
    pub range: Range<usize>,
    /// Whether it is of the boxes.
    pub of_boxes: bool,
    /// Whether a ray must come to each shape once only; else the device may split shapes, to trace faster.
    pub once: bool,
}

/// The input of a build: what of which kind there is, and how much.
pub struct Input {
    pub kind: vk::AccelerationStructureTypeKHR,
    geometry: [vk::AccelerationStructureGeometryKHR<'static>; 1],
    pub ranges: [vk::AccelerationStructureBuildRangeInfoKHR; 1],
}

impl Input {
    pub fn of_mesh(gpu: &Gpu, shapes: Shapes, mesh: &Mesh) -> Self {
        let count = mesh.range.len() as u32;
        let part = |of: Bound, first: u64, record: u64| vk::DeviceOrHostAddressConstKHR {
            device_address: address(gpu, of.buffer) + of.offset + first + mesh.range.start as u64 * record,
        };
        let once = vk::GeometryFlagsKHR::NO_DUPLICATE_ANY_HIT_INVOCATION;
        let flags = if mesh.once { once } else { vk::GeometryFlagsKHR::empty() };
        let geometry = vk::AccelerationStructureGeometryKHR::default().flags(flags);
        let geometry = match shapes.boxes.filter(|_| mesh.of_boxes) {
            Some(boxes) => {
                let stride = size_of::<Aabb>() as u64;
                let data = part(boxes, 0, stride);
                let aabbs = vk::AccelerationStructureGeometryAabbsDataKHR::default().data(data).stride(stride);
                geometry
                    .geometry_type(vk::GeometryTypeKHR::AABBS)
                    .geometry(vk::AccelerationStructureGeometryDataKHR { aabbs })
            }
            None => {
                let triangles = vk::AccelerationStructureGeometryTrianglesDataKHR::default()
                    .vertex_format(vk::Format::R32G32B32_SFLOAT)
                    .vertex_data(part(shapes.triangles, shapes.corner, 3 * shapes.stride))
                    .vertex_stride(shapes.stride)
                    .max_vertex((3 * count).saturating_sub(1))
                    .index_type(vk::IndexType::NONE_KHR);
                geometry
                    .geometry_type(vk::GeometryTypeKHR::TRIANGLES)
                    .geometry(vk::AccelerationStructureGeometryDataKHR { triangles })
            }
        };
        Self::new(vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL, geometry, count)
    }

    pub fn of_copies(gpu: &Gpu, records: &Buffer<Record>, count: usize) -> Self {
        let data = vk::DeviceOrHostAddressConstKHR { device_address: address(gpu, records.bound().buffer) };
        let instances = vk::AccelerationStructureGeometryInstancesDataKHR::default().data(data);
        let geometry = vk::AccelerationStructureGeometryKHR::default()
            .geometry_type(vk::GeometryTypeKHR::INSTANCES)
            .geometry(vk::AccelerationStructureGeometryDataKHR { instances });
        Self::new(vk::AccelerationStructureTypeKHR::TOP_LEVEL, geometry, count as u32)
    }

    fn new(
        kind: vk::AccelerationStructureTypeKHR,
        geometry: vk::AccelerationStructureGeometryKHR<'static>,
        count: u32,
    ) -> Self {
        let range = vk::AccelerationStructureBuildRangeInfoKHR { primitive_count: count, ..Default::default() };
        Self { kind, geometry: [geometry], ranges: [range] }
    }

    pub fn info(&self) -> vk::AccelerationStructureBuildGeometryInfoKHR<'_> {
        vk::AccelerationStructureBuildGeometryInfoKHR::default()
            .ty(self.kind)
            .flags(vk::BuildAccelerationStructureFlagsKHR::PREFER_FAST_TRACE)
            .mode(vk::BuildAccelerationStructureModeKHR::BUILD)
            .geometries(&self.geometry)
    }

    pub fn sizes(&self, queries: &RayQueries) -> vk::AccelerationStructureBuildSizesInfoKHR<'static> {
        let mut sizes = vk::AccelerationStructureBuildSizesInfoKHR::default();
        let counts = self.ranges.map(|range| range.primitive_count);
        let device = vk::AccelerationStructureBuildTypeKHR::DEVICE;
        // SAFETY: a complete info, with a count for its geometry.
        unsafe { queries.structures.get_acceleration_structure_build_sizes(device, &self.info(), &counts, &mut sizes) };
        sizes
    }

    pub fn create(
        &self,
        queries: &RayQueries,
        within: &Untyped,
        bytes: Range<u64>,
    ) -> Result<vk::AccelerationStructureKHR> {
        let info = vk::AccelerationStructureCreateInfoKHR::default()
            .buffer(within.raw)
            .offset(bytes.start)
            .size(bytes.end - bytes.start)
            .ty(self.kind);
        // SAFETY: a complete info, of a live buffer that has room and that goes after the structure.
        unsafe { queries.structures.create_acceleration_structure(&info, None) }.at("acceleration structure")
    }
}

/// Where the device finds a buffer, which was made on one that traces by ray queries.
pub fn address(gpu: &Gpu, buffer: &Untyped) -> u64 {
    let info = vk::BufferDeviceAddressInfo::default().buffer(buffer.raw);
    // SAFETY: a live buffer of this device, whose usage includes its address.
    unsafe { gpu.0.device.get_buffer_device_address(&info) }
}
