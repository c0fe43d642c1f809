//! What instructions make of constants.

/// What an instruction makes of 32-bit numbers and truths, which are 0 or 1; `None` for one that is not needed here and for a
/// division by zero.
pub fn evaluate(opcode: u16, operands: &[u32]) -> Option<u32> {
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
