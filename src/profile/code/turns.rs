//! How often a loop turns, where its counter begins, grows and ends by constants.
use super::module::{Binary, Block, Module};
use crate::spirv::evaluate;
use std::collections::BTreeSet;

/// More turns than any kernel's loop with constant bounds.
const MOST: u64 = 1 << 20;

/// A number that changes by a constant with every turn.
struct Counter {
    id: u32,
    /// Its value in the next turn.
    next: u32,
    first: u32,
    step: Binary,
}

/// Turns of the loop that begins with `header`; `None` where constants do not decide it. A loop that is also left in other ways
/// counts as if it were not.
pub fn of_loop(module: &Module, header: &Block, body: &BTreeSet<u32>) -> Option<u64> {
    let counters: Vec<Counter> = header.phis.iter().filter_map(|phi| counter(module, phi, body)).collect();
    let leaves = |block: &&Block| block.condition.is_some() && block.successors.iter().any(|next| !body.contains(next));
    let tests = module.blocks.iter().filter(|block| body.contains(&block.label)).filter(leaves);
    tests.filter_map(|block| counters.iter().find_map(|counter| turns(module, counter, block, body))).min()
}

fn counter(module: &Module, (id, ways): &(u32, Vec<[u32; 2]>), body: &BTreeSet<u32>) -> Option<Counter> {
    let from = |inside: bool| ways.iter().find(|[_, label]| body.contains(label) == inside).map(|[value, _]| *value);
    let (first, next) = (*module.constants.get(&from(false)?)?, from(true)?);
    let step = *module.binaries.get(&next)?;
    let by = step.operands.iter().find(|operand| *operand != id)?;
    module.constants.get(by)?;
    step.operands.contains(id).then_some(Counter { id: *id, next, first, step })
}

fn turns(module: &Module, counter: &Counter, test: &Block, body: &BTreeSet<u32>) -> Option<u64> {
    let stays = body.contains(test.successors.first()?);
    let comparison = module.binaries.get(&test.condition?)?;
    // The test reads the counter of this turn or, at the loop's end, of the next one.
    let of_next = comparison.operands.contains(&counter.next);
    let value = |id: u32, counted: u32| match id == counter.id || id == counter.next {
        true => Some(counted),
        false => module.constants.get(&id).copied(),
    };
    if !of_next && !comparison.operands.contains(&counter.id) {
        return None;
    }
    let apply = |binary: &Binary, counted: u32| {
        let [a, b] = binary.operands;
        evaluate(binary.opcode, &[value(a, counted)?, value(b, counted)?])
    };
    let mut counted = counter.first;
    for turn in 0..MOST {
        let next = apply(&counter.step, counted)?;
        let goes_on = (apply(comparison, if of_next { next } else { counted })? != 0) == stays;
        if !goes_on {
            return Some(turn + u64::from(of_next));
        }
        counted = next;
    }
    None
}
