//! The part of a SPIR-V module that counting needs: its blocks, what follows on each, and values that constants decide.
use crate::spirv::{Instruction, instructions, op, specialise};
use std::collections::BTreeMap;

/// Instructions without branches.
#[derive(Debug, Default)]
pub struct Block {
    pub label: u32,
    pub operations: u64,
    /// Labels of what may come next, where constants do not decide it.
    pub successors: Vec<u32>,
    /// Of a loop's first block: the block behind the loop.
    pub loop_merge: Option<u32>,
    /// What decides the way on.
    pub condition: Option<u32>,
    /// Values that depend on where control came from: id, then (value, label) of each way.
    pub phis: Vec<(u32, Vec<[u32; 2]>)>,
}

/// A result with two operands, which may be a loop's counter or its test.
#[derive(Clone, Copy, Debug)]
pub struct Binary {
    pub opcode: u16,
    pub operands: [u32; 2],
}

/// A module with one function, as the build script's compiler makes them.
pub struct Module {
    pub blocks: Vec<Block>,
    /// Values of constants by id; a truth is 0 or 1.
    pub constants: BTreeMap<u32, u32>,
    pub binaries: BTreeMap<u32, Binary>,
    places: BTreeMap<u32, usize>,
}

impl Module {
    /// `None` for damaged code.
    pub fn new(spirv: &[u8], constants: &[(u32, u32)]) -> Option<Self> {
        let words: Vec<u32> =
            spirv.chunks_exact(4).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]])).collect();
        let words = specialise(&words, constants);
        let instructions = instructions(&words)?;
        let (blocks, constants, binaries, places) = Default::default();
        let mut module = Self { blocks, constants, binaries, places };
        let mut types = Types::default();
        for instruction in &instructions {
            types.note(instruction);
            module.add(instruction, &types)?;
        }
        module.places = module.blocks.iter().enumerate().map(|(i, block)| (block.label, i)).collect();
        Some(module)
    }

    /// The first block of the function.
    pub fn entry(&self) -> Option<u32> {
        self.blocks.first().map(|block| block.label)
    }

    /// The block of this label.
    pub fn block(&self, label: u32) -> Option<&Block> {
        self.blocks.get(*self.places.get(&label)?)
    }

    fn add(&mut self, Instruction { opcode, words }: &Instruction, types: &Types) -> Option<()> {
        if *opcode == op::LABEL {
            self.blocks.push(Block { label: *words.first()?, ..Block::default() });
            return Some(());
        }
        match (*opcode, *words) {
            (op::CONSTANT_TRUE, &[_, id]) => _ = self.constants.insert(id, 1),
            (op::CONSTANT_FALSE, &[_, id]) => _ = self.constants.insert(id, 0),
            (op::CONSTANT, &[_, id, value]) => _ = self.constants.insert(id, value),
            (126..=205, &[_, id, a, b, ..]) => {
                _ = self.binaries.insert(id, Binary { opcode: *opcode, operands: [a, b] });
            }
            _ => {}
        }
        let Some(block) = self.blocks.last_mut() else { return Some(()) };
        block.operations += types.operations(*opcode, words);
        match (*opcode, *words) {
            (op::PHI, [_, id, ways @ ..]) => {
                let ways = ways.chunks_exact(2).map(|way| [way[0], way[1]]).collect();
                block.phis.push((*id, ways));
            }
            (op::LOOP_MERGE, [merge, ..]) => block.loop_merge = Some(*merge),
            (op::BRANCH, [next, ..]) => block.successors = vec![*next],
            (op::BRANCH_CONDITIONAL, [condition, yes, no, ..]) => {
                block.condition = Some(*condition);
                block.successors = match self.constants.get(condition) {
                    Some(0) => vec![*no],
                    Some(_) => vec![*yes],
                    None => vec![*yes, *no],
                };
            }
            (op::SWITCH, [_, default, ways @ ..]) => {
                block.successors = ways.chunks_exact(2).map(|way| way[1]).chain([*default]).collect();
            }
            _ => {}
        }
        Some(())
    }
}

/// How many components values have; a scalar has one.
#[derive(Default)]
struct Types {
    components: BTreeMap<u32, u64>,
    of_value: BTreeMap<u32, u32>,
}

impl Types {
    fn note(&mut self, Instruction { opcode, words }: &Instruction) {
        match (*opcode, *words) {
            (op::TYPE_VECTOR, [id, _, count, ..]) => _ = self.components.insert(*id, u64::from(*count)),
            (op::TYPE_MATRIX, [id, column, count, ..]) => {
                let components = self.of_type(*column) * u64::from(*count);
                self.components.insert(*id, components);
            }
            // Those whose operands begin with the type and the id of their result.
            (op::EXT_INST | 41..=52 | 61 | 79..=87 | 95..=100 | 109..=205 | op::PHI, [ty, id, ..]) => {
                _ = self.of_value.insert(*id, *ty)
            }
            _ => {}
        }
    }

    fn of_type(&self, ty: u32) -> u64 {
        self.components.get(&ty).copied().unwrap_or(1)
    }

    fn of_id(&self, id: u32) -> u64 {
        self.of_value.get(&id).map_or(1, |&ty| self.of_type(ty))
    }

    fn operations(&self, opcode: u16, words: &[u32]) -> u64 {
        let &[ty, _, ref operands @ ..] = words else { return 0 };
        let result = self.of_type(ty);
        let first = operands.first().map_or(1, |&id| self.of_id(id));
        match opcode {
            op::EXT_INST => result * function(operands.get(1).copied().unwrap_or(0)),
            // A bit cast computes nothing.
            109..=115 | 126..=143 | 149..=191 | 194..=205 => {
                result.max(if matches!(opcode, 154 | 155) { first } else { 1 })
            }
            // Each component of a product with a square matrix is a dot product.
            144 | 145 => result * (2 * result - 1),
            146 => result * (2 * result.isqrt() - 1),
            147 => result,
            148 => 2 * first - 1,
            _ => 0,
        }
    }
}

/// Operations per component of a function of GLSL.
fn function(number: u32) -> u64 {
    const FMA: u32 = 50;
    const LENGTH: u32 = 66;
    const NORMALIZE: u32 = 69;
    match number {
        FMA => 2,
        // The length of three components: three products, two sums and a root.
        LENGTH => 6,
        NORMALIZE => 3,
        _ => 1,
    }
}
