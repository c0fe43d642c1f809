//! Recording of the builds of acceleration structures.
use super::acceleration::{Acceleration, Input, Placement, Shapes, address};
use super::access::Access;
use super::shape::PassShape;
use super::{Bound, Buffer, Location, Recorder};
use crate::error::{Error, Result};
use ash::vk;

impl Recorder<'_> {
    /// Builds the structures of the `meshes` of these numbers from `shapes` as passes before have left them, and that over `copies`.
    /// What was built before is overwritten, after passes that read it. Memory that only the builds need goes with the frame.
    ///
    /// # Errors
    /// [`Error::Usage`] when there are more copies than there is room for or something was made on another device, [`Error::Device`]
    /// when a mesh of theirs begins beyond triangle 2^24, or memory is out.
    pub(crate) fn build(
        &mut self,
        acceleration: &Acceleration,
        shapes: Shapes,
        meshes: &[usize],
        copies: &[Placement],
    ) -> Result<()> {
        let gpu = self.gpu().clone();
        gpu.owns("the acceleration structures", &acceleration.handles.gpu)?;
        shapes.check(&gpu, &acceleration.meshes)?;
        if copies.len() > acceleration.records.len() {
            let (count, room) = (copies.len(), acceleration.records.len());
            return Err(Error::Usage(format!("{count} copies of meshes, and there is room for {room}")));
        }
        if !meshes.is_empty() {
            let inputs = meshes.iter().map(|&mesh| Input::of_mesh(&gpu, shapes, &acceleration.meshes[mesh])).collect();
            let targets: Vec<_> = meshes.iter().map(|&mesh| acceleration.handles.meshes[mesh]).collect();
            self.build_all("build_meshes", acceleration, &shapes.buffers(), inputs, &targets)?;
        }
        let queries = gpu.ray_queries()?;
        let records = copies.iter().map(|copy| acceleration.record_of(queries, copy)).collect::<Result<Vec<_>>>()?;
        self.upload(&acceleration.records, &[(0, &records)])?;
        let input = Input::of_copies(&gpu, &acceleration.records, copies.len());
        let read = [acceleration.records.bound()];
        self.build_all("build_copies", acceleration, &read, vec![input], &[acceleration.handles.top])
    }

    fn build_all(
        &mut self,
        name: &'static str,
        acceleration: &Acceleration,
        read: &[Bound],
        inputs: Vec<Input>,
        targets: &[vk::AccelerationStructureKHR],
    ) -> Result<()> {
        let gpu = self.gpu().clone();
        let queries = gpu.ray_queries()?;
        let align = |bytes: u64| bytes.next_multiple_of(queries.scratch_alignment);
        let needs: Vec<_> = inputs.iter().map(|input| align(input.sizes(queries).build_scratch_size)).collect();
        let bytes = needs.iter().sum::<u64>() + queries.scratch_alignment;
        let scratch = Buffer::<u32>::new(&gpu, "scratch of builds", bytes.div_ceil(4) as usize, Location::Device)?;
        let mut at = align(address(&gpu, scratch.bound().buffer));
        let mut infos = Vec::new();
        for ((input, target), need) in inputs.iter().zip(targets).zip(needs) {
            let memory = vk::DeviceOrHostAddressKHR { device_address: at };
            infos.push(input.info().dst_acceleration_structure(*target).scratch_data(memory));
            at += need;
        }
        let ranges: Vec<_> = inputs.iter().map(|input| &input.ranges[..]).collect();
        let written = [acceleration.handles.storage.bound().buffer, scratch.bound().buffer]
            .map(|buffer| (buffer, Access::BuildWrite));
        let accesses: Vec<_> = read.iter().map(|b| (b.buffer, Access::BuildRead)).chain(written).collect();
        let kinds: Vec<_> = accesses.iter().map(|(_, access)| *access).collect();
        let shape = PassShape::of_transfer(&kinds, acceleration.bytes());
        self.keep_structures(&acceleration.handles);
        // SAFETY: the frame keeps the structures and all buffers; addresses are of these and ranges within them.
        self.pass(name, &accesses, shape, &|_, commands| unsafe {
            queries.structures.cmd_build_acceleration_structures(commands, &infos, &ranges);
        })
    }
}
