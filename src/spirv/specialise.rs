//! A module with its specialisation constants set, without the code that they switch off. Drivers would remove it too, but only after
//! they have read, validated and inlined all of it: nine tenths of the path tracer are effects that a simple scene lacks.
//!
//! No instruction that computes something is changed, so results keep their bits as far as a driver's own optimisations are exact.
use super::compact::{compact, is_id};
use super::flow::{self, Flow, Ids, Value, label};
use super::instruction::{BOUND, HEADER, Instruction, instructions};
use super::op;
use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};

/// The decoration that names a specialisation constant by a number.
const SPEC_ID: u32 = 1;
/// The decoration of what the device provides, and of that the number of a thread within its subgroup.
const BUILT_IN: u32 = 11;
const SUBGROUP_LOCAL_INVOCATION_ID: u32 = 41;
/// Capabilities of subgroups, the first and the last.
const GROUP_NON_UNIFORM: u32 = 61;
const GROUP_NON_UNIFORM_QUAD: u32 = 68;

/// `module` with its specialisation constants set to `constants`, given as (constant id, value); others keep their defaults. Its ids
/// are numbered as by [`compact`]. What is no module is returned as it is, for the driver to refuse.
pub fn specialise(module: &[u32], constants: &[(u32, u32)]) -> Vec<u32> {
    let Some(instructions) = instructions(module) else { return module.to_vec() };
    let start = instructions.iter().position(|i| i.opcode == op::FUNCTION).unwrap_or(instructions.len());
    let (declarations, functions) = instructions.split_at(start);
    let mut specialised = Specialised::new(module[BOUND], constants);
    let declared: Vec<_> = declarations.iter().filter_map(|i| specialised.declare(i)).collect();
    for function in functions.chunk_by(|_, next| next.opcode != op::FUNCTION) {
        specialised.function(function);
    }
    let mut whole = module[..HEADER].to_vec();
    whole[BOUND] = specialised.bound;
    for (opcode, words) in declared.iter().filter_map(|declaration| specialised.left_of(declaration)) {
        Instruction { opcode, words: &words }.write(&mut whole);
    }
    for (&kind, &id) in &specialised.undefined {
        Instruction { opcode: op::UNDEF, words: &[kind, id] }.write(&mut whole);
    }
    whole.extend(specialised.body);
    compact(&whole).unwrap_or(whole)
}

/// Blocks that control does not reach but that structured control flow asks for, by their labels: merge blocks, and with the header of
/// their loop the blocks that continue one.
type Stubs = HashMap<u32, Option<u32>>;

struct Specialised<'a> {
    constants: &'a [(u32, u32)],
    /// The number of each specialisation constant that has one, by its id.
    numbers: HashMap<u32, u32>,
    types: Ids,
    /// The type of booleans.
    boolean: Option<u32>,
    flow: Flow,
    /// The functions as they are written.
    body: Vec<u32>,
    /// Results of instructions that were left out.
    removed: Ids,
    /// Variables that hold the number of a thread within its subgroup.
    lanes: Ids,
    /// Whether something is left that subgroups do together.
    by_subgroups: bool,
    /// Undefined values by their type, for the edges from [`Stubs`].
    undefined: BTreeMap<u32, u32>,
    /// All ids are below it.
    bound: u32,
}

impl<'a> Specialised<'a> {
    fn new(bound: u32, constants: &'a [(u32, u32)]) -> Self {
        let (numbers, boolean, body, by_subgroups, undefined) = Default::default();
        let [types, removed, lanes] = [(); 3].map(|()| Ids::new(bound));
        let flow = Flow::new(bound);
        Self { constants, numbers, types, boolean, flow, body, removed, lanes, by_subgroups, undefined, bound }
    }

    /// What is left of a declaration once the functions are written: neither names of what is gone nor, where subgroups do nothing,
    /// what only devices with such subgroups understand.
    fn left_of<'b>(&self, (opcode, words): &'b (u16, Vec<u32>)) -> Option<(u16, Cow<'b, [u32]>)> {
        let of_subgroups = |&id: &u32| !self.by_subgroups && self.lanes.contains(id);
        let stays = match (*opcode, &words[..]) {
            (op::NAME | op::DECORATE, [id, ..]) => !self.removed.contains(*id) && !of_subgroups(id),
            (op::VARIABLE, [_, id, ..]) => !of_subgroups(id),
            (op::CAPABILITY, [GROUP_NON_UNIFORM..=GROUP_NON_UNIFORM_QUAD]) => self.by_subgroups,
            _ => true,
        };
        let words = match *opcode {
            op::ENTRY_POINT => {
                let is_id = |place| is_id(&Instruction { opcode: *opcode, words }, place) == Some(true);
                let left = words.iter().enumerate().filter(|&(place, word)| !(is_id(place) && of_subgroups(word)));
                left.map(|(_, word)| *word).collect()
            }
            _ => Cow::Borrowed(&words[..]),
        };
        stays.then_some((*opcode, words))
    }

    /// Learns from a declaration, and returns what becomes of it: specialisation constants become constants, and their numbers go.
    fn declare(&mut self, Instruction { opcode, words }: &Instruction) -> Option<(u16, Vec<u32>)> {
        match (*opcode, *words) {
            (op::DECORATE, &[id, SPEC_ID, number]) => {
                self.numbers.insert(id, number);
                return None;
            }
            (op::DECORATE, &[id, BUILT_IN, SUBGROUP_LOCAL_INVOCATION_ID]) => self.lanes.insert(id),
            (op::TYPE_RAY_QUERY | op::TYPE_ACCELERATION_STRUCTURE, &[id]) => self.types.insert(id),
            (op::TYPE_VOID..=op::TYPE_FUNCTION, &[id, ref of @ ..]) => {
                self.types.insert(id);
                if *opcode == op::TYPE_BOOL {
                    self.boolean = Some(id);
                }
                if *opcode == op::TYPE_BOOL || *opcode == op::TYPE_INT && of[0] == 32 {
                    self.flow.scalars.insert(id);
                }
            }
            (op::CONSTANT_TRUE | op::SPEC_CONSTANT_TRUE, &[kind, id]) => return Some(self.truth(kind, id, 1)),
            (op::CONSTANT_FALSE | op::SPEC_CONSTANT_FALSE, &[kind, id]) => return Some(self.truth(kind, id, 0)),
            (op::CONSTANT | op::SPEC_CONSTANT, &[kind, id, default]) => {
                return Some(self.number(kind, id, self.chosen(id).unwrap_or(default)));
            }
            (op::SPEC_CONSTANT_OP, &[kind, id, operation, ref operands @ ..]) if self.flow.scalars.contains(kind) => {
                if let Value::Constant(value) = self.flow.evaluate(operation as u16, operands) {
                    let is_truth = self.boolean == Some(kind);
                    return Some(if is_truth { self.truth(kind, id, value) } else { self.number(kind, id, value) });
                }
            }
            _ => {}
        }
        Some((*opcode, words.to_vec()))
    }

    fn truth(&mut self, kind: u32, id: u32, default: u32) -> (u16, Vec<u32>) {
        let value = self.chosen(id).unwrap_or(default) != 0;
        self.flow.set(id, Value::Constant(value.into()));
        (if value { op::CONSTANT_TRUE } else { op::CONSTANT_FALSE }, vec![kind, id])
    }

    fn number(&mut self, kind: u32, id: u32, value: u32) -> (u16, Vec<u32>) {
        if self.flow.scalars.contains(kind) {
            self.flow.set(id, Value::Constant(value));
        }
        (op::CONSTANT, vec![kind, id, value])
    }

    fn chosen(&self, id: u32) -> Option<u32> {
        let number = self.numbers.get(&id)?;
        self.constants.iter().find(|(known, _)| known == number).map(|&(_, value)| value)
    }

    /// Writes what is left of a function, all of its instructions from the first to the last.
    fn function(&mut self, function: &[Instruction]) {
        let first = function.iter().position(|i| i.opcode == op::LABEL).unwrap_or(function.len());
        let (head, rest) = function.split_at(first);
        let (blocks, end) = rest.split_at(rest.len().saturating_sub(1));
        let blocks = flow::blocks(blocks);
        self.flow.propagate(&blocks);
        let stubs = self.stubs(&blocks);
        head.iter().for_each(|instruction| instruction.write(&mut self.body));
        for block in &blocks {
            if self.flow.reached.contains(label(block)) {
                self.reached(block, &stubs);
            } else {
                self.unreached(block, &stubs);
            }
        }
        end.iter().for_each(|instruction| instruction.write(&mut self.body));
    }

    fn stubs(&mut self, blocks: &[&[Instruction]]) -> Stubs {
        let mut stubs = Stubs::new();
        for block in blocks {
            if !self.flow.reached.contains(label(block)) {
                continue;
            }
            let decided = self.flow.decided(block);
            let keeps = decided.is_none() || self.flow.is_left_early(block);
            for Instruction { opcode, words } in block.iter() {
                match (*opcode, *words) {
                    (op::LOOP_MERGE, &[merge, next, ..]) => {
                        stubs.entry(merge).or_insert(None);
                        stubs.insert(next, Some(label(block)));
                    }
                    (op::SELECTION_MERGE, &[merge, _]) if keeps => _ = stubs.entry(merge).or_insert(None),
                    _ => {}
                }
            }
            if let Some([_, never]) = decided.filter(|_| keeps) {
                stubs.entry(never).or_insert(None);
                // So that its phis keep what comes from here.
                self.flow.add_edge(label(block), never);
            }
        }
        stubs.retain(|label, _| !self.flow.reached.contains(*label));
        stubs
    }

    fn reached(&mut self, block: &[Instruction], stubs: &Stubs) {
        let decided = self.flow.decided(block).filter(|_| !self.flow.is_left_early(block));
        for instruction in block {
            self.by_subgroups |= match instruction.opcode {
                op::GROUP_NON_UNIFORM_ELECT..=op::GROUP_NON_UNIFORM_QUAD_SWAP => true,
                op::LOAD => self.lanes.contains(instruction.words[2]),
                _ => false,
            };
            match (instruction.opcode, decided) {
                (op::PHI, _) => self.phi(instruction.words, label(block), stubs),
                (op::SELECTION_MERGE, Some(_)) => {}
                (op::BRANCH_CONDITIONAL, Some([target, _])) => {
                    Instruction { opcode: op::BRANCH, words: &[target] }.write(&mut self.body);
                }
                _ => instruction.write(&mut self.body),
            }
        }
    }

    fn unreached(&mut self, block: &[Instruction], stubs: &Stubs) {
        // An instruction has a result if its first operand is a type.
        for Instruction { words, .. } in block.iter().filter(|i| i.words.len() > 1 && self.types.contains(i.words[0])) {
            self.removed.insert(words[1]);
        }
        let Some(header) = stubs.get(&label(block)) else {
            self.removed.insert(label(block));
            return;
        };
        block[0].write(&mut self.body);
        match header {
            Some(header) => Instruction { opcode: op::BRANCH, words: &[*header] }.write(&mut self.body),
            None => Instruction { opcode: op::UNREACHABLE, words: &[] }.write(&mut self.body),
        }
    }

    /// Writes a phi of block `here` with the edges that are left.
    fn phi(&mut self, words: &[u32], here: u32, stubs: &Stubs) {
        let ways = words[2..].chunks_exact(2).filter(|way| self.flow.has_edge(way[1], here));
        let mut left: Vec<u32> = words[..2].iter().chain(ways.flatten()).copied().collect();
        if let Some((stub, _)) = stubs.iter().find(|(_, header)| **header == Some(here)) {
            let bound = &mut self.bound;
            let undefined = *self.undefined.entry(words[0]).or_insert_with(|| {
                *bound += 1;
                *bound - 1
            });
            left.extend([undefined, *stub]);
        }
        Instruction { opcode: op::PHI, words: &left }.write(&mut self.body);
    }
}

#[cfg(test)]
mod tests;
