//! Where control may go in a function, given what is constant: sparse conditional constant propagation (Wegman and Zadeck 1991) over
//! booleans and 32-bit integers. A value is constant if it is so along all edges that may be taken.
use super::evaluate::evaluate;
use super::instruction::Instruction;
use super::op;

/// What is known of an id. A value only ever moves down this list.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Value {
    /// Nothing that may be executed has computed it yet.
    Unknown,
    /// Of booleans 0 or 1.
    Constant(u32),
    Varying,
}
use Value::{Constant, Unknown, Varying};

impl Value {
    fn meet(self, other: Self) -> Self {
        match (self, other) {
            (Unknown, value) | (value, Unknown) => value,
            (Constant(a), Constant(b)) if a == b => self,
            _ => Varying,
        }
    }
}

/// A set of a module's ids.
pub struct Ids(Vec<bool>);

impl Ids {
    /// Empty, for ids below `bound`.
    pub fn new(bound: u32) -> Self {
        Self(vec![false; bound as usize])
    }

    pub fn insert(&mut self, id: u32) {
        self.0[id as usize] = true;
    }

    /// Of any word, also one that is no id.
    pub fn contains(&self, word: u32) -> bool {
        self.0.get(word as usize) == Some(&true)
    }
}

/// The blocks of a function, from its first label to its last block's last instruction. A block comes after those that dominate it.
pub fn blocks<'a>(instructions: &'a [Instruction<'a>]) -> Vec<&'a [Instruction<'a>]> {
    instructions.chunk_by(|_, next| next.opcode != op::LABEL).collect()
}

pub fn label(block: &[Instruction]) -> u32 {
    block[0].words[0]
}

/// What is known of a module's ids, and where control goes in it.
pub struct Flow {
    /// What is known of each id, at its place.
    values: Vec<Value>,
    /// The types whose values are followed: booleans and 32-bit integers.
    pub scalars: Ids,
    /// Labels of blocks that may be executed.
    pub reached: Ids,
    /// By label, place of the block in its function.
    places: Vec<u32>,
    /// By place of a block of the latest function, the labels of those from which edges to it may be taken.
    origins: Vec<Vec<u32>>,
    /// By the same, number of edges to it that may be taken.
    incoming: Vec<u32>,
}

impl Flow {
    /// Of a module whose ids are below `bound`.
    pub fn new(bound: u32) -> Self {
        Self {
            values: vec![Varying; bound as usize],
            scalars: Ids::new(bound),
            reached: Ids::new(bound),
            places: vec![0; bound as usize],
            origins: Vec::new(),
            incoming: Vec::new(),
        }
    }

    pub fn set(&mut self, id: u32, value: Value) {
        self.values[id as usize] = value;
    }

    fn value(&self, id: u32) -> Value {
        self.values[id as usize]
    }

    /// The value of an instruction, [`Varying`] if it is not one of those that are followed.
    pub fn evaluate(&self, opcode: u16, operands: &[u32]) -> Value {
        let values = operands.iter().map(|&id| self.values.get(id as usize).copied().unwrap_or(Varying));
        let values: Vec<Value> = values.collect();
        match (opcode, &values[..]) {
            (op::SELECT, &[Constant(choice), yes, no]) => return if choice != 0 { yes } else { no },
            (op::LOGICAL_AND, values) if values.contains(&Constant(0)) => return Constant(0),
            (op::LOGICAL_OR, values) if values.contains(&Constant(1)) => return Constant(1),
            (_, values) if values.contains(&Varying) => return Varying,
            _ => {}
        }
        let constant = |value: &Value| if let Constant(number) = value { Some(*number) } else { None };
        let Some(numbers) = values.iter().map(constant).collect::<Option<Vec<_>>>() else { return Unknown };
        evaluate(opcode, &numbers).map_or(Varying, Constant)
    }

    /// Is its result followed? It is where a number or a truth is computed or comes from another block.
    fn follows(&self, Instruction { opcode, words }: &Instruction) -> bool {
        let known = matches!(*opcode, op::I_ADD..=op::S_MOD | op::LOGICAL_EQUAL..=op::S_LESS_THAN_EQUAL | op::PHI);
        known && self.scalars.contains(words[0])
    }

    /// Finds the values of a function and the edges that may be taken.
    pub fn propagate(&mut self, blocks: &[&[Instruction]]) {
        for instruction in blocks.iter().copied().flatten() {
            if self.follows(instruction) {
                self.set(instruction.words[1], Unknown);
            }
        }
        for (place, block) in (0..).zip(blocks) {
            self.places[label(block) as usize] = place;
        }
        (self.origins, self.incoming) = (vec![Vec::new(); blocks.len()], vec![0; blocks.len()]);
        blocks.iter().take(1).for_each(|entry| self.reached.insert(label(entry)));
        let mut changed = true;
        while std::mem::take(&mut changed) {
            for block in blocks {
                if self.reached.contains(label(block)) {
                    changed |= self.execute(block);
                }
            }
        }
    }

    /// Returns whether anything is known now that was not before.
    fn execute(&mut self, block: &[Instruction]) -> bool {
        let (here, mut changed) = (label(block), false);
        for instruction in block {
            if self.follows(instruction) {
                let (id, operands) = (instruction.words[1], &instruction.words[2..]);
                let value = match instruction.opcode {
                    op::PHI => self.joined(here, operands),
                    opcode => self.evaluate(opcode, operands),
                };
                changed |= self.value(id) != value;
                self.set(id, value);
            }
        }
        for target in self.targets(block) {
            self.reached.insert(target);
            if self.add_edge(here, target) {
                let place = self.place(target);
                self.incoming[place] += 1;
                changed = true;
            }
        }
        changed
    }

    fn place(&self, label: u32) -> usize {
        self.places[label as usize] as usize
    }

    /// Notes an edge between the blocks of two labels; returns whether it is new.
    pub fn add_edge(&mut self, from: u32, to: u32) -> bool {
        let (is_new, place) = (!self.has_edge(from, to), self.place(to));
        if is_new {
            self.origins[place].push(from);
        }
        is_new
    }

    /// Whether an edge between the blocks of two labels may be taken.
    pub fn has_edge(&self, from: u32, to: u32) -> bool {
        self.origins[self.place(to)].contains(&from)
    }

    /// What a phi of block `here` is, of values that come along edges that may be taken.
    fn joined(&self, here: u32, ways: &[u32]) -> Value {
        let taken = ways.chunks_exact(2).filter(|way| self.has_edge(way[1], here));
        taken.map(|way| self.value(way[0])).fold(Unknown, Value::meet)
    }

    /// Where a block may go on, as far as is known.
    fn targets(&self, block: &[Instruction]) -> Vec<u32> {
        let Instruction { opcode, words } = block[block.len() - 1];
        match opcode {
            op::BRANCH => vec![words[0]],
            op::BRANCH_CONDITIONAL => match (self.decided(block), self.value(words[0])) {
                (Some([target, _]), _) => vec![target],
                (None, Unknown) => Vec::new(),
                (None, _) => words[1..3].to_vec(),
            },
            // A selector of 32 bits, whose cases are pairs of a number and a label.
            op::SWITCH => words[1..].iter().step_by(2).copied().collect(),
            _ => Vec::new(),
        }
    }

    /// Where a conditional branch whose condition is constant goes, and where it never goes. The branch that closes a loop counts as
    /// undecided, because every loop of SPIR-V has one.
    pub fn decided(&self, block: &[Instruction]) -> Option<[u32; 2]> {
        let Instruction { opcode, words } = block[block.len() - 1];
        let &[condition, yes, no, ..] = words else { return None };
        let back = |target: u32| self.place(target) <= self.place(label(block));
        if opcode != op::BRANCH_CONDITIONAL || yes == no || back(yes) || back(no) {
            return None;
        }
        match self.value(condition) {
            Constant(0) => Some([no, yes]),
            Constant(_) => Some([yes, no]),
            _ => None,
        }
    }

    /// Must a selection keep its form although its condition is constant? It must if several branches end at its merge block: only
    /// because it is one may they leave what lies between.
    pub fn is_left_early(&self, block: &[Instruction]) -> bool {
        let merge = block.iter().find(|i| i.opcode == op::SELECTION_MERGE).map(|i| i.words[0]);
        merge.is_some_and(|merge| self.incoming[self.place(merge)] > 1)
    }
}
