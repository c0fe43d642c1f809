//! The constants of a SPIR-V module, those that a kernel is specialised by included.
use super::instruction::Instruction;
use std::collections::BTreeMap;

/// Values of 32-bit numbers and truths by id; a truth is 0 or 1.
pub struct Constants(BTreeMap<u32, u32>);

impl Constants {
    /// Those of a module; `specialised` replaces defaults, as (constant id, value).
    pub fn new(instructions: &[Instruction], specialised: &[(u32, u32)]) -> Self {
        const DECORATE: u16 = 71;
        const SPEC_ID: u32 = 1;
        let (mut values, mut numbers) = (BTreeMap::new(), BTreeMap::new());
        for Instruction { opcode, words } in instructions {
            match (*opcode, *words) {
                (DECORATE, [id, SPEC_ID, number, ..]) => _ = numbers.insert(*id, *number),
                (41 | 48, [_, id, ..]) => _ = values.insert(*id, 1),
                (42 | 49, [_, id, ..]) => _ = values.insert(*id, 0),
                (43 | 50, [_, id, value]) => _ = values.insert(*id, *value),
                (52, [_, id, operation, operands @ ..]) => {
                    let operands: Option<Vec<u32>> = operands.iter().map(|id| values.get(id).copied()).collect();
                    let value = operands.and_then(|operands| evaluate(*operation, &operands));
                    value.map(|value| values.insert(*id, value));
                }
                _ => {}
            }
            // Decorations come before what they decorate.
            if let (48..=50, &[_, id, ..]) = (*opcode, *words) {
                let given = numbers.get(&id).and_then(|number| specialised.iter().find(|(n, _)| n == number));
                given.map(|(_, value)| values.insert(id, *value));
            }
        }
        Self(values)
    }

    /// The value of an id; `None` where it is no constant.
    pub fn value(&self, id: u32) -> Option<u32> {
        self.0.get(&id).copied()
    }
}

/// What an instruction makes of constants; `None` for one that is not needed here.
pub fn evaluate(opcode: u32, operands: &[u32]) -> Option<u32> {
    if let (169, &[choice, yes, no]) = (opcode, operands) {
        return Some(if choice != 0 { yes } else { no });
    }
    if let (168, &[value]) = (opcode, operands) {
        return Some(u32::from(value == 0));
    }
    let &[a, b] = operands else { return None };
    let (signed_a, signed_b) = (a as i32, b as i32);
    Some(match opcode {
        128 => a.wrapping_add(b),
        130 => a.wrapping_sub(b),
        132 => a.wrapping_mul(b),
        134 => a.checked_div(b)?,
        135 => signed_a.checked_div(signed_b)? as u32,
        137 => a.checked_rem(b)?,
        166 => a | b,
        167 => a & b,
        _ => u32::from(match opcode {
            164 | 170 => a == b,
            165 | 171 => a != b,
            172 => a > b,
            173 => signed_a > signed_b,
            174 => a >= b,
            175 => signed_a >= signed_b,
            176 => a < b,
            177 => signed_a < signed_b,
            178 => a <= b,
            179 => signed_a <= signed_b,
            _ => return None,
        }),
    })
}
