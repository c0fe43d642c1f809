//! What instructions make of constants.
use super::op;

/// What an instruction makes of 32-bit numbers and truths, which are 0 or 1; `None` for one that is not needed here and for a
/// division by zero.
pub fn evaluate(opcode: u16, operands: &[u32]) -> Option<u32> {
    match (opcode, operands) {
        (op::SELECT, &[choice, yes, no]) => return Some(if choice != 0 { yes } else { no }),
        (op::LOGICAL_NOT, &[value]) => return Some(u32::from(value == 0)),
        _ => {}
    }
    let &[a, b] = operands else { return None };
    let (signed_a, signed_b) = (a as i32, b as i32);
    Some(match opcode {
        op::I_ADD => a.wrapping_add(b),
        op::I_SUB => a.wrapping_sub(b),
        op::I_MUL => a.wrapping_mul(b),
        op::U_DIV => a.checked_div(b)?,
        op::S_DIV => signed_a.checked_div(signed_b)? as u32,
        op::U_MOD => a.checked_rem(b)?,
        op::LOGICAL_OR => a | b,
        op::LOGICAL_AND => a & b,
        _ => u32::from(match opcode {
            op::LOGICAL_EQUAL | op::I_EQUAL => a == b,
            op::LOGICAL_NOT_EQUAL | op::I_NOT_EQUAL => a != b,
            op::U_GREATER_THAN => a > b,
            op::S_GREATER_THAN => signed_a > signed_b,
            op::U_GREATER_THAN_EQUAL => a >= b,
            op::S_GREATER_THAN_EQUAL => signed_a >= signed_b,
            op::U_LESS_THAN => a < b,
            op::S_LESS_THAN => signed_a < signed_b,
            op::U_LESS_THAN_EQUAL => a <= b,
            op::S_LESS_THAN_EQUAL => signed_a <= signed_b,
            _ => return None,
        }),
    })
}
