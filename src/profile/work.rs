//! How much the passes of a frame do, counted from what they were recorded with.
//!
//! Bytes: every byte of every buffer that a pass binds counts once where the kernel reads it and once where it writes it, as if a
//! cache held all that is read twice. Some kernels bind more than they touch. `path` reads nodes of the scene's hierarchy at
//! random: counted are the nodes that rays visited, and its samples. Of a wavefront count the nodes of `path_extend`, and what either stage
//! reads and writes of the paths whose closest hits were looked for; those that waited for a shadow ray alone are more.
//! `accumulate` touches the samples that `path` left, and its share of the film. `primary_hit` counts what it writes, as nobody
//! counts its nodes. Triangles, textures and lights do not count.
//!
//! Operations: see [`super::code`]. Those of `path` are its steps through the hierarchy, one for each node; shading does not count.
use super::code::Code;
use crate::gpu::{Access, BoundRange, KernelCode, Pass};
use crate::layout::{BvhNode, Effect, vec4};
use crate::render::Counters;
use crate::render::pass::wavefront::{BYTES_OF_HIT, BYTES_OF_RAY, BYTES_PER_PATH};
use crate::shaders::shared::{window_blocks, windows};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;

/// A number, and whether more was done than it counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Amount {
    /// What was counted.
    pub count: u64,
    /// Whether part of the work cannot be counted.
    pub is_least: bool,
}

impl Amount {
    fn add(&mut self, count: u64, is_least: bool) {
        self.count = self.count.saturating_add(count);
        self.is_least |= is_least;
    }
}

/// What all calls of a pass in a frame do.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Work {
    /// Times that it ran.
    pub calls: u64,
    /// Workgroups; 0 of a copy, a fill or an update.
    pub workgroups: u64,
    /// Threads of all workgroups.
    pub threads: u64,
    /// Bytes of the buffers that the largest call touches: what must fit a cache to stay in it.
    pub working_set: u64,
    /// Bytes read and written.
    pub bytes: Amount,
    /// Operations.
    pub operations: Amount,
}

/// What the passes of a frame have in common.
#[derive(Clone, Copy, Debug)]
pub struct FrameWork {
    /// Pixels of the film.
    pub pixels: u64,
    /// Whether direct and indirect light are kept apart.
    pub split_light: bool,
    /// Rays of the frame and the nodes that they visited.
    pub counters: Counters,
}

impl FrameWork {
    /// The work of each pass, in the order in which they first ran.
    pub fn of(&self, passes: &[Pass]) -> Vec<(String, Work)> {
        let mut all: Vec<(String, Work)> = Vec::new();
        let (mut codes, mut paths) = (HashMap::new(), 0);
        let generated =
            passes.iter().filter(|pass| pass.time.name == "path_generate").map(|pass| pass.shape.threads).sum();
        for pass in passes {
            let name = pass.time.name;
            let at = all.iter().position(|(known, _)| known == name).unwrap_or_else(|| {
                all.push((name.to_owned(), Work::default()));
                all.len() - 1
            });
            if matches!(name, "path" | "path_generate") {
                paths = pass.shape.threads;
            }
            let work = &mut all[at].1;
            if work.calls == 0 {
                work.bytes.add(self.bytes_of_waiting(name, generated), false);
            }
            self.add(work, pass, paths, &mut codes);
        }
        all
    }

    fn add(&self, work: &mut Work, pass: &Pass, paths: u64, codes: &mut HashMap<Key, Option<Code>>) {
        let shape = &pass.shape;
        let is_first = work.calls == 0;
        work.calls += 1;
        work.workgroups += shape.groups.iter().map(|&n| u64::from(n)).product::<u64>();
        work.threads += shape.threads;
        work.working_set = work.working_set.max(self.working_set(pass, paths));
        let (bytes, is_least) = self.bytes(pass, paths);
        work.bytes.add(bytes, is_least);
        let Some(code) = &shape.code else { return };
        let count = codes.entry(key(code)).or_insert_with(|| Code::new(code.spirv, &without_walls(&code.constants)));
        let Some(count) = count else { return work.operations.add(0, true) };
        if matches!(pass.time.name, "path" | "path_extend") {
            // The counters are of the whole frame.
            let nodes = if is_first { self.counters.nodes } else { 0 };
            work.bytes.add(nodes * size_of::<BvhNode>() as u64, true);
            return work.operations.add(nodes.saturating_mul(count.largest_step()), true);
        }
        let each = count.per_thread(&self.turns(pass, code, paths));
        work.operations.add(each.count.saturating_mul(shape.threads), each.is_least);
    }

    /// Of a sample that `path` leaves.
    fn bytes_of_sample(&self) -> u64 {
        size_of::<vec4>() as u64 * if self.split_light { 3 } else { 1 }
    }

    /// What a stage of a wavefront reads and writes of its paths in all calls, `paths` of which leave the eye. Each path that waits for
    /// a closest hit is shaded behind it, and all of them but those from the eye were written by shading.
    fn bytes_of_waiting(&self, stage: &str, paths: u64) -> u64 {
        let Counters { closest, any, .. } = self.counters;
        match stage {
            "path_extend" => (closest + any) * BYTES_OF_RAY + closest * BYTES_OF_HIT,
            "path_shade" => {
                let vector = size_of::<vec4>() as u64;
                let kept = BYTES_PER_PATH - vector * if self.split_light { 1 } else { 2 }; // soft light may be kept, and albedo
                let read = kept - 2 * vector; // all but the shadow ray
                closest * read + closest.saturating_sub(paths) * kept + paths * self.bytes_of_sample()
            }
            _ => 0,
        }
    }

    fn bytes(&self, pass: &Pass, paths: u64) -> (u64, bool) {
        let (ranges, record) = (&pass.shape.ranges, self.bytes_of_sample());
        let sum = |of: &dyn Fn(&BoundRange) -> u64| ranges.iter().map(|range| moves(range) * of(range)).sum();
        match pass.time.name {
            "path" => (paths * record, true),
            "path_extend" | "path_shade" => (0, true),
            "primary_hit" => (sum(&|range| if range.name == "guides" { range.bytes } else { 0 }), true),
            "accumulate" => {
                let share = |bytes: u64| bytes.min(bytes.saturating_mul(pass.shape.threads) / self.pixels.max(1));
                let touched = |range: &BoundRange| match range.name {
                    "samples" => range.bytes.min(paths * record),
                    _ => share(range.bytes),
                };
                (sum(&touched), false)
            }
            _ => (sum(&|range| range.bytes), false),
        }
    }

    /// Each byte once. Rays may visit all nodes.
    fn working_set(&self, pass: &Pass, paths: u64) -> u64 {
        let ranges = &pass.shape.ranges;
        let nodes = ranges.iter().filter(|range| range.name == "nodes").map(|range| range.bytes).sum::<u64>();
        match pass.time.name {
            "path" | "path_extend" | "path_shade" | "primary_hit" => self.bytes(pass, paths).0 + nodes,
            _ => ranges.iter().map(|range| range.bytes).sum(),
        }
    }

    /// Turns of the loops that constants do not decide, where the shape does.
    fn turns(&self, pass: &Pass, code: &KernelCode, paths: u64) -> Vec<u64> {
        let threads = pass.shape.threads.max(1);
        let constant =
            |id: u32| code.constants.iter().find(|(n, _)| *n == id).map(|(_, value)| u64::from((*value).max(1)));
        let windows = windows::Constants { tile: TILE_MARK, ..Default::default() }.entries();
        let marks = [&windows[..], &window_blocks::Constants { step: STEP_MARK }.entries()].concat();
        let id = |mark: i32| marks.iter().find(|(_, value)| *value == mark as u32).map(|(id, _)| *id);
        match pass.time.name {
            // The samples of a pixel, in one of two loops.
            "accumulate" => vec![paths / threads, 0],
            // A thread takes its windows in tiles.
            name if name.starts_with("guided_") => {
                let of = |mark| id(mark).and_then(constant);
                let windows = self.pixels / of(STEP_MARK).unwrap_or(1).pow(2);
                of(TILE_MARK).map(|tile| windows.div_ceil(threads).div_ceil(tile)).into_iter().collect()
            }
            _ => Vec::new(),
        }
    }
}

/// Values by which the ids of two constants are found, as the build script knows only their names.
const TILE_MARK: i32 = i32::MAX;
const STEP_MARK: i32 = i32::MAX - 1;

type Key = (usize, Vec<(u32, u32)>);

/// Each kernel's code lies at an address of its own.
fn key(code: &KernelCode) -> Key {
    (code.spirv.as_ptr() as usize, code.constants.to_vec())
}

/// The code of clear walls lies in the loop of the traversal, but few of a ray's steps meet any.
fn without_walls(constants: &[(u32, u32)]) -> Vec<(u32, u32)> {
    let walls = |id: u32| id == Effect::clear_walls as u32;
    constants.iter().map(|&(id, value)| (id, if walls(id) { 0 } else { value })).collect()
}

/// How often the bytes of a range move: once in each direction.
fn moves(range: &BoundRange) -> u64 {
    if range.access == Access::ReadWrite { 2 } else { 1 }
}
