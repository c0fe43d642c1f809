//! Counts the operations of a kernel in its SPIR-V, with its specialisation constants applied.
//!
//! Every component that an instruction computes counts as one operation: arithmetic, comparisons, conversions, bits, and the
//! functions of GLSL. A multiplication with an addition in one instruction counts as two, a dot product of n components as 2n - 1.
//! Loads, stores and moves do not count. Both sides of a branch count, unless a constant decides it. Turns of loops are found where
//! their counter and its bounds are constants; others are told by the caller, or count once.
mod module;
mod turns;

use module::{Block, Module};
use std::collections::{BTreeMap, BTreeSet};

/// The operations of a thread.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Operations {
    /// Their number.
    pub count: u64,
    /// Whether a loop was counted once, because its turns are not known.
    pub is_least: bool,
}

/// The loops and operations of a kernel.
pub struct Code {
    /// Operations outside of all loops.
    outside: u64,
    /// In the order of the code.
    loops: Vec<Loop>,
}

struct Loop {
    /// Operations of a turn, those of the loops within it left out.
    own: u64,
    /// The loop around it, an index of an earlier one.
    parent: Option<usize>,
    /// `None` where only the device knows.
    turns: Option<u64>,
}

impl Code {
    /// Reads the code of a kernel. `None` for code that is damaged or not understood.
    pub fn new(spirv: &[u8], constants: &[(u32, u32)]) -> Option<Self> {
        let module = Module::new(spirv, constants)?;
        let live = reachable(&module, module.entry()?, None);
        let is_header = |block: &&Block| block.loop_merge.is_some() && live.contains(&block.label);
        let headers: Vec<&Block> = module.blocks.iter().filter(is_header).collect();
        let bodies: Vec<_> = headers.iter().map(|h| reachable(&module, h.label, h.loop_merge)).collect();
        // The smallest loop that holds a block is the innermost.
        let innermost = |label: u32, but: Option<usize>| {
            let around = (0..bodies.len()).filter(|&i| Some(i) != but && bodies[i].contains(&label));
            around.min_by_key(|&i| bodies[i].len())
        };
        let mut own: BTreeMap<Option<usize>, u64> = BTreeMap::new();
        for block in module.blocks.iter().filter(|block| live.contains(&block.label)) {
            *own.entry(innermost(block.label, None)).or_default() += block.operations;
        }
        let of = |i: Option<usize>| own.get(&i).copied().unwrap_or(0);
        let each = headers.iter().enumerate().map(|(i, header)| Loop {
            own: of(Some(i)),
            parent: innermost(header.label, Some(i)).filter(|&outer| bodies[outer].len() > bodies[i].len()),
            turns: turns::of_loop(&module, header, &bodies[i]),
        });
        Some(Self { outside: of(None), loops: each.collect() })
    }

    /// Operations of a thread. `told`: the turns of those loops that constants do not decide, in the order of the code.
    pub fn per_thread(&self, told: &[u64]) -> Operations {
        let mut told = told.iter().copied();
        let mut is_least = false;
        let mut count = self.outside;
        let mut times = Vec::with_capacity(self.loops.len());
        for each in &self.loops {
            let turns = each.turns.or_else(|| told.next());
            is_least |= turns.is_none();
            let around: u64 = each.parent.map_or(1, |i| times.get(i).copied().unwrap_or(1));
            let all = around.saturating_mul(turns.unwrap_or(1));
            times.push(all);
            count = count.saturating_add(all.saturating_mul(each.own));
        }
        Operations { count, is_least }
    }

    /// Operations in a turn of the largest loop whose turns only the device knows and that holds no other of that kind: in a
    /// kernel that traces rays, a step of the traversal.
    pub fn largest_step(&self) -> u64 {
        let unknown = |i: &usize| self.loops[*i].turns.is_none();
        let holds = |outer: usize, inner: usize| self.within(inner, outer).is_some();
        let is_innermost = |i: &usize| !(0..self.loops.len()).any(|j| unknown(&j) && j != *i && holds(*i, j));
        let steps = (0..self.loops.len()).filter(|i| unknown(i) && is_innermost(i));
        steps.map(|i| self.turn(i)).max().unwrap_or(0)
    }

    /// Operations of one turn of a loop, with all turns of the loops within it.
    fn turn(&self, outer: usize) -> u64 {
        let within =
            (0..self.loops.len()).filter_map(|i| Some(self.within(i, outer)?.saturating_mul(self.loops[i].own)));
        within.fold(self.loops[outer].own, u64::saturating_add)
    }

    /// How often loop `inner` turns while `outer` does once; `None` if it is not within it.
    fn within(&self, inner: usize, outer: usize) -> Option<u64> {
        let (mut at, mut times) = (inner, 1u64);
        while at != outer {
            times = times.saturating_mul(self.loops[at].turns.unwrap_or(1));
            at = self.loops[at].parent?;
        }
        Some(times).filter(|_| inner != outer)
    }
}

/// The blocks that control reaches from one of them without passing `end`.
fn reachable(module: &Module, from: u32, end: Option<u32>) -> BTreeSet<u32> {
    let (mut seen, mut open) = (BTreeSet::new(), vec![from]);
    while let Some(label) = open.pop() {
        let Some(block) = module.block(label).filter(|_| Some(label) != end) else { continue };
        if seen.insert(label) {
            open.extend(&block.successors);
        }
    }
    seen
}

#[cfg(test)]
mod tests;
