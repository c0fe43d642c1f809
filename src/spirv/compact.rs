//! The ids of a module, numbered without gaps. `glslc -O` uses only about one number in ten, and what [`super::specialise`] removes
//! frees more. Drivers, and what reads a module here, keep tables with a place for every number below the bound.
use super::instruction::{BOUND, HEADER, Instruction, instructions};
use super::op;

/// `module` with its ids numbered from 1 in the order of their first mention, and the bound that they need.
///
/// # Errors
/// Why it is left as it is: it is no module, or holds an instruction that nothing here knows the operands of.
pub fn compact(module: &[u32]) -> Result<Vec<u32>, String> {
    let instructions = instructions(module).ok_or("no SPIR-V module")?;
    // The number of each id; 0 while it has none.
    let mut numbers = vec![0; module[BOUND] as usize];
    let mut bound = 1;
    let mut whole = module.to_vec();
    let mut at = HEADER;
    for instruction in &instructions {
        for (place, word) in (0..).zip(&mut whole[at + 1..][..instruction.words.len()]) {
            let unknown = || format!("operands that src/spirv/compact.rs does not know: {instruction:?}");
            if is_id(instruction, place).ok_or_else(unknown)? {
                let number = numbers
                    .get_mut(*word as usize)
                    .ok_or_else(|| format!("an id beyond its bound: {instruction:?}"))?;
                if *number == 0 {
                    *number = bound;
                    bound += 1;
                }
                *word = *number;
            }
        }
        at += 1 + instruction.words.len();
    }
    whole[BOUND] = bound;
    Ok(whole)
}

/// Whether the operand at `place` of an instruction is an id, not a number nor a part of a text; `None` for instructions that kernels
/// do not have.
pub(super) fn is_id(Instruction { opcode, words }: &Instruction, place: usize) -> Option<bool> {
    Some(match *opcode {
        op::EXTENSION | op::MEMORY_MODEL | op::CAPABILITY => false,
        op::NAME | op::EXT_INST_IMPORT | op::TYPE_INT | op::TYPE_FLOAT => place == 0,
        op::DECORATE | op::MEMBER_DECORATE | op::SELECTION_MERGE => place == 0,
        op::TYPE_VECTOR | op::TYPE_MATRIX | op::TYPE_IMAGE | op::CONSTANT | op::SPEC_CONSTANT => place < 2,
        op::LOOP_MERGE => place < 2,
        op::COMPOSITE_EXTRACT | op::BRANCH_CONDITIONAL => place < 3,
        op::VECTOR_SHUFFLE | op::COMPOSITE_INSERT => place < 4,
        op::TYPE_POINTER | op::EXECUTION_MODE_ID => place != 1,
        op::FUNCTION | op::VARIABLE => place != 2,
        op::SPEC_CONSTANT_OP if has_only_ids(words[2] as u16) => place != 2,
        op::EXT_INST => place != 3,
        op::IMAGE_FETCH => place != 4,
        // Pairs of a number and a label follow the selector and the default.
        op::SWITCH => place < 2 || place % 2 == 1,
        op::ENTRY_POINT => {
            // A name's last word ends with a zero.
            let name = words[2..].iter().take_while(|&&word| word >> 24 != 0).count() + 1;
            place == 1 || place >= 2 + name
        }
        // Not what they tell of a place in memory, which may be numbers and ids.
        op::LOAD if words.len() == 3 => true,
        op::STORE if words.len() == 2 => true,
        other if has_only_ids(other) => true,
        _ => return None,
    })
}

/// Whether all operands are ids.
fn has_only_ids(opcode: u16) -> bool {
    let declares = matches!(
        opcode,
        op::UNDEF | op::TYPE_VOID | op::TYPE_BOOL | op::TYPE_ARRAY
            ..=op::TYPE_STRUCT
                | op::TYPE_FUNCTION
                | op::CONSTANT_TRUE
                | op::CONSTANT_FALSE
                | op::CONSTANT_COMPOSITE
                | op::SPEC_CONSTANT_TRUE
                | op::SPEC_CONSTANT_FALSE
                | op::TYPE_ACCELERATION_STRUCTURE
    );
    let computes = matches!(
        opcode,
        op::ACCESS_CHAIN
            | op::VECTOR_EXTRACT_DYNAMIC
            | op::COMPOSITE_CONSTRUCT
            | op::TRANSPOSE
            | op::CONVERT_F_TO_U..=op::BITCAST
            | op::S_NEGATE..=op::BIT_COUNT
            | op::CONTROL_BARRIER..=op::ATOMIC_XOR
            | op::GROUP_NON_UNIFORM_SHUFFLE
            | op::COPY_LOGICAL
            | op::TYPE_RAY_QUERY..=op::RAY_QUERY_GET_INTERSECTION_TYPE
            | op::RAY_QUERY_GET_RAY_T_MIN..=op::RAY_QUERY_GET_INTERSECTION_WORLD_TO_OBJECT
    );
    let leads_on = matches!(opcode, op::FUNCTION_END | op::PHI | op::LABEL | op::BRANCH | op::RETURN | op::UNREACHABLE);
    declares || computes || leads_on
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spirv::specialise;
    use std::collections::BTreeSet;

    #[test]
    fn ids_are_numbered_as_they_come_and_other_operands_stay() {
        const NAME_OF_MAIN: u32 = 0x6e69_616d;
        let module = |bound, lines: &[(u16, &[u32])]| {
            let mut whole = vec![0x0723_0203, 0x0001_0600, 0, bound, 0];
            lines.iter().for_each(|&(opcode, words)| Instruction { opcode, words }.write(&mut whole));
            whole
        };
        let sparse = module(
            100,
            &[
                (op::CAPABILITY, &[20]),
                (op::EXT_INST_IMPORT, &[90, NAME_OF_MAIN, 0]),
                (op::ENTRY_POINT, &[20, 30, NAME_OF_MAIN, 0, 40]),
                (op::DECORATE, &[40, 20, 30]),
                (op::TYPE_INT, &[20, 32, 0]),
                (op::CONSTANT, &[20, 50, 20]),
                (op::SPEC_CONSTANT_OP, &[20, 51, op::I_ADD.into(), 50, 50]),
                (op::LABEL, &[60]),
                (op::EXT_INST, &[20, 61, 90, 20, 50]),
                (op::SELECTION_MERGE, &[63, 20]),
                (op::SWITCH, &[61, 62, 20, 63, 30, 62]),
                (op::LABEL, &[62]),
                (op::PHI, &[20, 64, 50, 60]),
            ],
        );
        let dense = module(
            12,
            &[
                (op::CAPABILITY, &[20]),
                (op::EXT_INST_IMPORT, &[1, NAME_OF_MAIN, 0]),
                (op::ENTRY_POINT, &[20, 2, NAME_OF_MAIN, 0, 3]),
                (op::DECORATE, &[3, 20, 30]),
                (op::TYPE_INT, &[4, 32, 0]),
                (op::CONSTANT, &[4, 5, 20]),
                (op::SPEC_CONSTANT_OP, &[4, 6, op::I_ADD.into(), 5, 5]),
                (op::LABEL, &[7]),
                (op::EXT_INST, &[4, 8, 1, 20, 5]),
                (op::SELECTION_MERGE, &[9, 20]),
                (op::SWITCH, &[8, 10, 20, 9, 30, 10]),
                (op::LABEL, &[10]),
                (op::PHI, &[4, 11, 5, 7]),
            ],
        );
        assert_eq!(compact(&sparse).unwrap(), dense);
        assert_eq!(compact(&dense).unwrap(), dense);
    }

    #[test]
    fn what_nothing_here_knows_is_told() {
        const IMAGE_WRITE: u32 = 99;
        let header = [0x0723_0203, 0x0001_0600, 0, 10, 0];
        let why = |rest: &[u32]| compact(&[&header[..], rest].concat()).unwrap_err();
        assert!(why(&[2 << 16 | IMAGE_WRITE, 7]).contains("opcode: 99"));
        assert!(why(&[2 << 16 | u32::from(op::LABEL), 10]).contains("beyond its bound"));
        assert_eq!(compact(&header[..4]).unwrap_err(), "no SPIR-V module");
    }

    /// The ids that a module's instructions make.
    fn made(module: &[u32]) -> BTreeSet<u32> {
        let mut types = BTreeSet::new();
        let made = instructions(module).unwrap().into_iter().filter_map(|Instruction { opcode, words }| match opcode {
            op::TYPE_VOID..=op::TYPE_FUNCTION | op::TYPE_RAY_QUERY | op::TYPE_ACCELERATION_STRUCTURE => {
                types.insert(words[0]);
                Some(words[0])
            }
            op::LABEL | op::EXT_INST_IMPORT => Some(words[0]),
            _ => words.first().filter(|kind| types.contains(kind)).map(|_| words[1]),
        });
        made.collect()
    }

    /// As they are shipped, and as drivers get them.
    #[test]
    fn kernels_use_every_number_below_their_bound() {
        let kernels = std::fs::read_dir(concat!(env!("OUT_DIR"), "/spirv")).unwrap();
        let mut count = 0;
        for kernel in kernels {
            let path = kernel.unwrap().path();
            let whole: Vec<u32> = bytemuck::pod_collect_to_vec(&std::fs::read(&path).unwrap());
            for module in [specialise(&whole, &[]), whole] {
                assert!(made(&module).into_iter().eq(1..module[BOUND]), "{}", path.display());
            }
            count += 1;
        }
        assert!(count > 50, "{count}");
    }
}
